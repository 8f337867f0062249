//! The panes and where they are: a tree of tiles that can be moved, closed, brought back and reset.

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
    /// The ladder of models.
    Stages,
    /// Error over seconds, and where to stop.
    Trade,
    /// What happened.
    Log,
}

impl Pane {
    /// All panes, in the order in which the menu shows them.
    pub fn all() -> Vec<Pane> {
        let pictures = Quantity::ALL.into_iter().map(Pane::Picture);
        let rest = [
            Self::Compare,
            Self::Model,
            Self::Objects,
            Self::Material,
            Self::Lights,
            Self::Insert,
            Self::Settings,
            Self::Capture,
            Self::Loss,
            Self::Stages,
            Self::Trade,
            Self::Log,
        ];
        pictures.chain(rest).collect()
    }

    /// Title of the tab.
    pub fn title(self) -> &'static str {
        match self {
            Self::Picture(quantity) => quantity.name(),
            Self::Compare => "Compare",
            Self::Model => "3D view",
            Self::Objects => "Objects",
            Self::Material => "Material",
            Self::Lights => "Lights",
            Self::Insert => "Insert",
            Self::Settings => "Settings",
            Self::Capture => "Capture",
            Self::Loss => "Loss",
            Self::Stages => "Stages",
            Self::Trade => "Trade",
            Self::Log => "Log",
        }
    }
}

/// What the panes are arranged for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Workspace {
    /// Changing a photograph: it is large.
    #[default]
    Compose,
    /// Looking into what was found: all pictures in a grid.
    Inspect,
}

impl Workspace {
    /// Its layout of the first start; made for 1280 × 800 and up.
    pub fn first_layout(self) -> Tree<Pane> {
        match self {
            Self::Compose => compose(),
            Self::Inspect => inspect(),
        }
    }
}

fn compose() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let mut tabs = |panes: &[Pane]| {
        let children: Vec<TileId> = panes.iter().map(|&pane| tiles.insert_pane(pane)).collect();
        tiles.insert_tab_tile(children)
    };
    let hero = tabs(&[
        Pane::Picture(Quantity::Composite),
        Pane::Model,
        Pane::Compare,
    ]);
    let side = tabs(&[Pane::Objects, Pane::Lights, Pane::Insert]);
    let course = tabs(&[
        Pane::Material,
        Pane::Loss,
        Pane::Stages,
        Pane::Settings,
        Pane::Log,
    ]);
    let right = tiles.insert_vertical_tile(vec![side, course]);
    let root = tiles.insert_horizontal_tile(vec![hero, right]);
    set_sizes(&mut tiles, root, &[(hero, 0.69), (right, 0.31)]);
    set_sizes(&mut tiles, right, &[(side, 0.6), (course, 0.4)]);
    Tree::new(egui::Id::unique("compose"), root, tiles)
}

fn inspect() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let mut tabs = |panes: &[Pane]| {
        let children: Vec<TileId> = panes.iter().map(|&pane| tiles.insert_pane(pane)).collect();
        tiles.insert_tab_tile(children)
    };
    let picture = Pane::Picture;
    let photograph = tabs(&[picture(Quantity::Photograph), Pane::Compare]);
    let render = tabs(&[picture(Quantity::Render), picture(Quantity::Composite)]);
    let model = tabs(&[Pane::Model]);
    let albedo = tabs(&[
        picture(Quantity::Albedo),
        picture(Quantity::Emission),
        picture(Quantity::Irradiance),
    ]);
    let error = tabs(&[picture(Quantity::Error), picture(Quantity::StandardError)]);
    let side = tabs(&[
        Pane::Objects,
        Pane::Lights,
        Pane::Insert,
        Pane::Settings,
        Pane::Trade,
    ]);
    let course = tabs(&[
        Pane::Loss,
        Pane::Material,
        Pane::Stages,
        Pane::Capture,
        Pane::Log,
    ]);
    let upper = tiles.insert_horizontal_tile(vec![photograph, render]);
    let lower = tiles.insert_horizontal_tile(vec![model, albedo, error]);
    let views = tiles.insert_vertical_tile(vec![upper, lower]);
    let right = tiles.insert_vertical_tile(vec![side, course]);
    let root = tiles.insert_horizontal_tile(vec![views, right]);
    set_sizes(&mut tiles, root, &[(views, 0.69), (right, 0.31)]);
    set_sizes(&mut tiles, views, &[(upper, 0.53), (lower, 0.47)]);
    set_sizes(&mut tiles, right, &[(side, 0.62), (course, 0.38)]);
    Tree::new(egui::Id::unique("inspect"), root, tiles)
}

fn set_sizes(tiles: &mut Tiles<Pane>, parent: TileId, fractions: &[(TileId, f32)]) {
    if let Some(Tile::Container(Container::Linear(linear))) = tiles.get_mut(parent) {
        for &(child, fraction) in fractions {
            linear.shares.set_share(child, fraction);
        }
    }
}

/// Brings a pane to the front, opening it beside the last where it was closed.
pub fn show(tree: &mut Tree<Pane>, pane: Pane) {
    let found = tree.tiles.find_pane(&pane);
    let Some(tile) = found else {
        let tile = tree.tiles.insert_pane(pane);
        match tree.root {
            Some(root) => {
                tree.move_tile_to_container(tile, largest_tabs(tree, root), usize::MAX, true)
            }
            None => tree.root = Some(tile),
        }
        tree.make_active(|id, _| id == tile);
        return;
    };
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
    tree.tiles
        .iter()
        .filter(|(_, tile)| matches!(tile, Tile::Container(Container::Tabs(_))))
        .max_by(|(a, _), (b, _)| {
            let area = |id: TileId| tree.tiles.rect(id).map_or(0.0, |rect| rect.area());
            area(**a).total_cmp(&area(**b)).then(b.0.cmp(&a.0))
        })
        .map_or(root, |(id, _)| *id)
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
