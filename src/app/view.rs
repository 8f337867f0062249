//! What is shown and how. Nothing of it is saved with the capture or undone.

use crate::app::document::Document;
use crate::app::insertion::Adding;
use crate::app::layout::Pane;
use crate::app::model::view::ModelView;
use crate::app::panels::objects::ObjectsTable;
use crate::app::picture::drawn::{Derived, Drawn};
use crate::app::picture::look::{Compare, Look};
use crate::app::picture::quantity::Quantity;
use crate::app::request::Requests;
use crate::app::selection::Selection;
use crate::app::shell::Shell;
use crate::app::shown::Shown;
use crate::app::tool::Tool;
use crate::app::trade::TradeView;

#[derive(Default)]
pub struct ViewState {
    /// Whose pictures are shown.
    pub shown: Shown,
    /// How pictures are looked at.
    pub look: Look,
    pub compare: Compare,
    /// Pictures made of the worker's.
    pub derived: Derived,
    /// What the panes of this pass show.
    pub needed: Needed,
    pub selection: Selection,
    /// What a click does.
    pub tool: Tool,
    /// The 3D view.
    pub model: ModelView,
    /// The panes of words and numbers.
    pub panels: PanelsView,
    /// What is around and above the panes.
    pub shell: Shell,
    /// What is asked of the layout.
    pub layout: LayoutRequest,
}

/// What a pane borrows.
pub struct Parts<'a> {
    pub document: &'a Document,
    pub view: &'a mut ViewState,
    pub requests: &'a mut Requests,
}

/// How the panes of words and numbers are shown.
#[derive(Default)]
pub struct PanelsView {
    pub objects: ObjectsTable,
    pub adding: Adding,
    pub trade: TradeView,
}

/// What the panes of a pass need.
#[derive(Debug, Clone, Copy, Default)]
pub struct Needed {
    /// The most pixels that a pane shows along a side.
    pub pixels: f32,
    /// Whether a pane shows a composite.
    pub composite: bool,
    /// Whether a pane shows the re-render, or what is made of it.
    pub render: bool,
    /// Whether the light of each lamp is asked for apart.
    pub layers: bool,
    /// Whether a pane shows the irradiance.
    pub irradiance: bool,
}

impl Needed {
    /// Notes that a picture is shown.
    pub fn note(&mut self, quantity: Quantity) {
        use Quantity::{Composite, Error, Irradiance, Naive, NaiveEstimate, Render};
        self.composite |= matches!(quantity, Composite | Naive | NaiveEstimate);
        self.render |= matches!(quantity, Render | Error | Irradiance);
        self.irradiance |= quantity == Irradiance;
    }
}

/// What is asked of the layout in this pass.
#[derive(Debug, Clone, Copy, Default)]
pub struct LayoutRequest {
    /// A pane to bring to the front.
    pub front: Option<Pane>,
    /// Whether to put all panes back where they were at first.
    pub reset: bool,
}

impl ViewState {
    pub fn drawn(&self, document: &Document, quantity: Quantity) -> Option<Drawn> {
        let sized = self.needed.composite;
        (self.derived).drawn(document, &self.shown, sized, quantity)
    }

    pub fn bring_forward(&mut self, pane: Pane) {
        self.layout.front = Some(pane);
    }
}
