//! Which view is shown: a photograph's, or the 3D view's.

use crate::app::document::Document;
use crate::app::tool::Clicked;
use crate::scene::camera::Camera;
use crate::session::snapshot::{Insertion, View};
use egui::Pos2;
use std::sync::Arc;

#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// The chosen photograph.
    pub frame: usize,
    /// The 3D view's camera where pictures are rendered from it.
    pub free: Option<Box<Camera>>,
}

impl Shown {
    /// The photograph that is shown, unless the 3D view is.
    pub fn photograph(&self) -> Option<usize> {
        self.free.is_none().then_some(self.frame)
    }

    pub fn show(&mut self, frame: usize) {
        (self.frame, self.free) = (frame, None);
    }

    /// Goes `by` of so many photographs on, around the ends.
    pub fn step(&mut self, by: isize, frames: usize) {
        if frames > 0 {
            self.show((self.frame as isize + by).rem_euclid(frames as isize) as usize);
        }
    }

    pub fn camera<'a>(&'a self, document: &'a Document) -> Option<&'a Camera> {
        match &self.free {
            Some(camera) => Some(camera),
            None => document.capture()?.scene.cameras.get(self.frame),
        }
    }

    /// The pictures of the shown view, once the worker has sent them.
    pub fn view<'a>(&self, document: &'a Document) -> Option<&'a Arc<View>> {
        let view = document.snapshot.view.as_ref();
        view.filter(|view| view.frame == self.photograph())
    }

    /// The composites of the shown photograph, once the worker has sent them.
    pub fn insertion<'a>(&self, document: &'a Document) -> Option<&'a Arc<Insertion>> {
        let insertion = document.snapshot.insertion.as_ref();
        insertion.filter(|insertion| Some(insertion.frame) == self.photograph())
    }

    /// The surface at a point of the shown view, given in fractions of its size.
    pub fn surface_at(&self, document: &Document, at: Pos2) -> Option<Clicked> {
        let scene = &document.capture()?.scene;
        let ray = ray(self.camera(document)?, at);
        Clicked::new(scene, &ray, &scene.intersect(&ray)?)
    }
}

/// The ray through a point of a camera's picture, given in fractions of its size.
pub fn ray(camera: &Camera, at: Pos2) -> crate::scene::geometry::Ray {
    let k = &camera.intrinsics;
    camera.ray(glam::vec2(at.x * k.width as f32, at.y * k.height as f32))
}
