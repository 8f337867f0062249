//! The panes and where they are: a tree of tiles that can be moved, closed, brought back and reset.

use crate::app::controls::choices;
use crate::app::picture::quantity::Quantity;
use egui_tiles::{Container, Tile, TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

/// What a tile shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pane {
    /// One picture of the view.
    Picture(Quantity),
    /// Two pictures under a wipe, flipped, or side by side.
    Compare,
    /// The mesh in 3D.
    Model,
    /// The table of objects.
    Objects,
    /// Colour and light of the selected object.
    Material,
    /// The light of each lamp.
    Lights,
    /// Inserting objects.
    Insert,
    /// The solver's parameters.
    Settings,
    /// The summary of the capture.
    Capture,
    /// The loss curve.
    Loss,
    /// The stages of the solve.
    Stages,
    /// Error over seconds, and where to stop.
    Trade,
    /// What happened.
    Log,
}

impl Pane {
    /// All panes, in the order in which the menu shows them.
    pub fn all() -> Vec<Pane> {
        use Pane::*;
        let pictures = Quantity::ALL.map(Picture);
        let others = [
            Compare, Model, Objects, Material, Lights, Insert, Settings, Capture, Loss, Stages,
            Trade, Log,
        ];
        [&pictures[..], &others].concat()
    }

    /// Title of the tab.
    pub fn title(self) -> String {
        match self {
            Self::Picture(quantity) => quantity.name().to_owned(),
            Self::Model => "3D view".to_owned(),
            other => format!("{other:?}"),
        }
    }
}

choices! {
    /// What the panes are arranged for.
    Workspace {
        Compose, "compose", "Changing a photograph: it is large";
        Inspect, "inspect", "Looking into what was found: all pictures in a grid";
    }
}

impl Workspace {
    /// Its layout of the first start; made for 1280 × 800 and up.
    pub fn first_layout(self) -> Tree<Pane> {
        use {Pane::*, Quantity::*};
        let mut tiles = Tiles::default();
        let mut tabs = |pictures: &[Quantity], others: &[Pane]| {
            let pictures = pictures.iter().map(|&quantity| Picture(quantity));
            let panes = pictures.chain(others.iter().copied());
            let children: Vec<TileId> = panes.map(|pane| tiles.insert_pane(pane)).collect();
            tiles.insert_tab_tile(children)
        };
        let side = [Objects, Lights, Insert];
        let (views, side, below, heights) = match self {
            Self::Compose => {
                let views = tabs(&[Composite], &[Model, Compare]);
                let below = [Material, Loss, Stages, Settings, Log];
                (views, tabs(&[], &side), tabs(&[], &below), [0.6, 0.4])
            }
            Self::Inspect => {
                let photograph = tabs(&[Photograph], &[Compare]);
                let render = tabs(&[Render, Composite], &[]);
                let model = tabs(&[], &[Model]);
                let albedo = tabs(&[Albedo, Emission, Irradiance], &[]);
                let error = tabs(&[Error, StandardError], &[]);
                let side = tabs(&[], &[&side[..], &[Settings, Trade]].concat());
                let below = tabs(&[], &[Loss, Material, Stages, Capture, Log]);
                let upper = tiles.insert_horizontal_tile(vec![photograph, render]);
                let lower = tiles.insert_horizontal_tile(vec![model, albedo, error]);
                let views = tiles.insert_vertical_tile(vec![upper, lower]);
                set_sizes(&mut tiles, views, [(upper, 0.53), (lower, 0.47)]);
                (views, side, below, [0.62, 0.38])
            }
        };
        let right = tiles.insert_vertical_tile(vec![side, below]);
        let root = tiles.insert_horizontal_tile(vec![views, right]);
        set_sizes(&mut tiles, root, [(views, 0.69), (right, 0.31)]);
        set_sizes(&mut tiles, right, [(side, heights[0]), (below, heights[1])]);
        Tree::new(egui::Id::unique(self.name()), root, tiles)
    }
}

fn set_sizes(tiles: &mut Tiles<Pane>, parent: TileId, fractions: [(TileId, f32); 2]) {
    if let Some(Tile::Container(Container::Linear(linear))) = tiles.get_mut(parent) {
        for (child, fraction) in fractions {
            linear.shares.set_share(child, fraction);
        }
    }
}

/// Brings a pane to the front, opening it beside the last where it was closed.
pub fn show(tree: &mut Tree<Pane>, pane: Pane) {
    let tile = tree.tiles.find_pane(&pane).unwrap_or_else(|| {
        let tile = tree.tiles.insert_pane(pane);
        match tree.root {
            Some(root) => {
                tree.move_tile_to_container(tile, largest_tabs(tree, root), usize::MAX, true);
            }
            None => tree.root = Some(tile),
        }
        tile
    });
    tree.tiles.set_visible(tile, true);
    tree.make_active(|id, _| id == tile);
}

/// Closes a pane if it is open.
pub fn close(tree: &mut Tree<Pane>, pane: Pane) {
    if let Some(tile) = tree.tiles.find_pane(&pane) {
        tree.remove_recursively(tile);
    }
}

/// Whether a pane is open, in front or behind another.
pub fn is_open(tree: &Tree<Pane>, pane: Pane) -> bool {
    tree.tiles.find_pane(&pane).is_some()
}

/// The container of tabs that takes most of the window, or the root.
fn largest_tabs(tree: &Tree<Pane>, root: TileId) -> TileId {
    let area = |id: TileId| tree.tiles.rect(id).map_or(0.0, |rect| rect.area());
    let is_tabs = |tile: &Tile<Pane>| matches!(tile, Tile::Container(Container::Tabs(_)));
    let tabs = tree.tiles.iter().filter(|(_, tile)| is_tabs(tile));
    tabs.map(|(id, _)| *id)
        .max_by(|&a, &b| area(a).total_cmp(&area(b)).then(b.0.cmp(&a.0)))
        .unwrap_or(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pane_can_be_closed_and_brought_back() {
        for workspace in [Workspace::Compose, Workspace::Inspect] {
            let mut tree = workspace.first_layout();
            for pane in Pane::all() {
                close(&mut tree, pane);
                assert!(!is_open(&tree, pane), "{pane:?}");
                show(&mut tree, pane);
                assert!(is_open(&tree, pane), "{pane:?}");
            }
            for pane in Pane::all() {
                close(&mut tree, pane);
            }
            show(&mut tree, Pane::Loss);
            assert!(is_open(&tree, Pane::Loss));
        }
    }
}
