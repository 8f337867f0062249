//! Renders pictures of one lit scene.

use crate::gpu::{Tracer, View};
use crate::render::renderer::Renderer;
use crate::scene::camera::Camera;
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;

/// Renders views of one lit scene.
#[derive(Debug)]
pub struct Pictures<'a> {
    renderer: Renderer,
    lit: &'a LitScene,
    tracer: Option<Tracer>,
}

impl<'a> Pictures<'a> {
    /// Renders a scene on the card if the renderer has one that accepts it.
    pub fn new(renderer: &Renderer, lit: &'a LitScene) -> Self {
        Self {
            tracer: renderer.tracer(lit, &[]),
            renderer: renderer.clone(),
            lit,
        }
    }

    /// A picture from `samples` paths per pixel, keyed by (seed, frame). If the card fails, a warning is written and the processor
    /// renders this picture and all later ones.
    pub fn film(
        &mut self,
        camera: &Camera,
        options: &PathOptions,
        (seed, frame): (u64, u64),
        samples: u32,
    ) -> Film {
        let view = View {
            camera,
            options,
            seed,
            frame,
        };
        let by_card = |_: &mut (), tracer: &mut Tracer| tracer.film(&view, samples);
        let film = self.renderer.on_card(&mut (), &mut self.tracer, by_card);
        film.unwrap_or_else(|| {
            let mut film = Film::new(camera);
            film.add(self.lit, camera, options, seed, frame, samples);
            film
        })
    }
}
