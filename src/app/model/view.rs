//! The state of the 3D view, and the faces and colours that are made for it on a thread of their own.

use crate::app::model::coloring::Coloring;
use crate::app::model::lasso::Lasso;
use crate::app::model::orbit::Orbit;
use crate::app::model::surface::Surface;
use crate::app::task::Task;
use crate::inverse::estimate::Estimate;
use crate::say;
use crate::session::snapshot::OpenCapture;
use glam::Vec3;
use std::sync::Arc;

pub type Colors = Arc<Vec<[f32; 4]>>;

/// Faces, and the radiance of each in the photographs once that is known.
type Made = (Arc<Surface>, Vec<Option<Vec3>>);

pub struct ModelView {
    pub orbit: Orbit,
    pub coloring: Coloring,
    /// Whether faces seen from behind are left out, so that one can look into a room.
    pub cull: bool,
    /// Whether the photographs' cameras are drawn.
    pub cameras: bool,
    pub lasso: Lasso,
    made: Option<Made>,
    making: Option<Task<Made, ()>>,
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
            made: None,
            making: None,
            colors: None,
        }
    }
}

impl ModelView {
    /// Makes faces and colours anew, after the objects of the mesh have changed.
    pub fn remake(&mut self) {
        (self.made, self.making, self.colors) = (None, None, None);
        self.lasso = Lasso::default();
    }

    /// The faces and their present colours, once they are made.
    pub fn faces(
        &mut self,
        ctx: &egui::Context,
        capture: &Arc<OpenCapture>,
        estimate: &Arc<Estimate>,
    ) -> Option<(Arc<Surface>, Colors)> {
        if self.making.is_none() {
            let capture = capture.clone();
            let made = Task::begin("3D view", ctx, move |progress| {
                let surface = Arc::new(Surface::new(&capture.scene));
                progress.show((surface.clone(), Vec::new()));
                if !progress.is_cancelled() {
                    progress.show((surface.clone(), surface.photographed(&capture)));
                }
                Ok(())
            });
            let made = made.map_err(|error| say::note(format_args!("{error}")));
            self.making = made.ok();
        }
        if let Some(made) = self.making.as_ref().and_then(Task::newest) {
            (self.made, self.colors) = (Some(made), None);
        }
        let (surface, photographed) = self.made.as_ref()?;
        let depends = !matches!(self.coloring, Coloring::Photograph | Coloring::Object);
        if let Some((coloring, made_of, colors)) = &self.colors
            && *coloring == self.coloring
            && (!depends || Arc::ptr_eq(made_of, estimate))
        {
            return Some((surface.clone(), colors.clone()));
        }
        let scene = &capture.scene;
        let colors = Arc::new((self.coloring).colors(surface, scene, estimate, photographed));
        self.colors = Some((self.coloring, estimate.clone(), colors.clone()));
        Some((surface.clone(), colors))
    }
}
