//! The state of the 3D view, and the faces and colours that are made for it on a thread of their own.

use crate::app::model::coloring::Coloring;
use crate::app::model::lasso::Lasso;
use crate::app::model::orbit::Orbit;
use crate::app::model::surface::Surface;
use crate::inverse::estimate::Estimate;
use crate::say;
use crate::session::snapshot::OpenCapture;
use glam::Vec3;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

/// Colours of all faces.
pub type Colors = Arc<Vec<[f32; 4]>>;

/// What the thread sends.
enum Made {
    Surface(Arc<Surface>),
    Photographed(Vec<Option<Vec3>>),
}

/// The state of the 3D view.
pub struct ModelView {
    /// Its camera.
    pub orbit: Orbit,
    /// What faces are coloured by.
    pub coloring: Coloring,
    /// Whether faces seen from behind are left out, so that one can look into a room.
    pub cull: bool,
    /// Whether the photographs' cameras are drawn.
    pub cameras: bool,
    /// The line that is being drawn.
    pub lasso: Lasso,
    surface: Option<Arc<Surface>>,
    photographed: Vec<Option<Vec3>>,
    making: Option<Receiver<Made>>,
    colors: Option<(Coloring, Arc<Estimate>, Colors)>,
}

impl Default for ModelView {
    fn default() -> Self {
        Self {
            orbit: Orbit::default(),
            coloring: Coloring::Photograph,
            cull: true,
            cameras: true,
            lasso: Lasso::default(),
            surface: None,
            photographed: Vec::new(),
            making: None,
            colors: None,
        }
    }
}

impl ModelView {
    /// Makes faces and colours anew, for a mesh whose objects are others.
    pub fn remake(&mut self) {
        (self.surface, self.making, self.colors) = (None, None, None);
        self.lasso = Lasso::default();
        self.photographed.clear();
    }

    /// The faces and their present colours, once they are made.
    pub fn faces(
        &mut self,
        ctx: &egui::Context,
        capture: &Arc<OpenCapture>,
        estimate: &Arc<Estimate>,
    ) -> Option<(Arc<Surface>, Colors)> {
        let receiver = self.making.get_or_insert_with(|| make(ctx, capture));
        while let Ok(made) = receiver.try_recv() {
            match made {
                Made::Surface(surface) => self.surface = Some(surface),
                Made::Photographed(colors) => {
                    self.photographed = colors;
                    self.colors = None;
                }
            }
        }
        let surface = self.surface.clone()?;
        let depends = !matches!(self.coloring, Coloring::Photograph | Coloring::Object);
        if let Some((coloring, made_of, colors)) = &self.colors
            && *coloring == self.coloring
            && (!depends || Arc::ptr_eq(made_of, estimate))
        {
            return Some((surface, colors.clone()));
        }
        let colors =
            Arc::new(
                self.coloring
                    .colors(&surface, &capture.scene, estimate, &self.photographed),
            );
        self.colors = Some((self.coloring, estimate.clone(), colors.clone()));
        Some((surface, colors))
    }
}

/// Cuts up the mesh and colours it by the photographs, on a thread; wakes the window as parts are ready.
fn make(ctx: &egui::Context, capture: &Arc<OpenCapture>) -> Receiver<Made> {
    let (sender, receiver) = channel();
    let (ctx, capture) = (ctx.clone(), capture.clone());
    let spawned = std::thread::Builder::new()
        .name("3D view".to_owned())
        .spawn(move || {
            let surface = Arc::new(Surface::new(&capture.scene));
            let sent = sender.send(Made::Surface(surface.clone()));
            ctx.request_repaint();
            if sent.is_ok()
                && sender
                    .send(Made::Photographed(surface.photographed(&capture)))
                    .is_ok()
            {
                ctx.request_repaint();
            }
        });
    if let Err(error) = spawned {
        say::aside(format_args!("3D view: {error}; close other programs"));
    }
    receiver
}
