//! One view being drawn.

use crate::inverse::estimate::Estimate;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::command::{ViewCamera, ViewRequest};
use crate::session::snapshot::{OpenCapture, Picture, View};
use crate::session::view::hits::Hits;
use crate::session::view::sized::{box_filter, repeat, shrink};
use glam::Vec3;
use std::sync::Arc;

/// A change of a colour by less than this share does not show.
const VISIBLE: f32 = 0.01;

/// A camera's pictures on their way from coarse to sharp.
#[derive(Debug)]
pub struct Target {
    scene: Arc<Scene>,
    frame: Option<usize>,
    camera: Camera,
    estimate: Arc<Estimate>,
    photograph: Option<Arc<Picture>>,
    /// The camera of the coarse first picture, until that is drawn.
    coarse: Option<Camera>,
    hits: Option<Hits>,
    /// Whether the pictures of albedo, emission and error are behind the estimate.
    stale: bool,
}

impl Target {
    /// Prepares a view; `None` if its frame does not exist.
    pub fn new(
        capture: &OpenCapture,
        estimate: &Arc<Estimate>,
        request: &ViewRequest,
        first_long_side: u32,
    ) -> Option<Self> {
        let scene = capture.scene.clone();
        let (frame, camera) = match &request.camera {
            ViewCamera::Frame(frame) => (Some(*frame), scene.cameras.get(*frame)?.clone()),
            ViewCamera::Free(camera) => (None, camera.as_ref().clone()),
        };
        let camera = shrink(&camera, request.long_side);
        let photograph = frame.and_then(|frame| {
            let photograph = capture.photographs.get(frame)?;
            let whole = Picture {
                width: photograph.width,
                height: photograph.height,
                pixels: photograph.pixels.clone(),
            };
            let k = &camera.intrinsics;
            Some(Arc::new(box_filter(&whole, k.width, k.height)))
        });
        let coarse = shrink(&camera, first_long_side);
        Some(Self {
            scene,
            frame,
            camera,
            estimate: estimate.clone(),
            photograph,
            coarse: Some(coarse),
            hits: None,
            stale: true,
        })
    }

    /// Takes up another estimate if it differs to the eye.
    pub fn follow(&mut self, estimate: &Arc<Estimate>) {
        if !Arc::ptr_eq(&self.estimate, estimate) && differs(&self.estimate, estimate) {
            self.estimate = estimate.clone();
            self.stale = true;
        }
    }

    /// Forgets the samples taken with earlier estimates.
    pub fn start_over(&mut self) {
        self.stale = true;
    }

    /// Whether there is nothing left to draw.
    pub fn is_done(&self) -> bool {
        self.coarse.is_none() && !self.stale
    }

    /// Draws the next slice; the pictures, if a new set is ready.
    pub fn sharpen(&mut self, sequence: u64) -> Option<View> {
        if let Some(coarse) = self.coarse.take() {
            let hits = Hits::new(&self.scene, &coarse);
            return Some(self.view(sequence, &coarse, &hits));
        }
        if !self.stale {
            return None;
        }
        self.stale = false;
        let hits = self
            .hits
            .take()
            .unwrap_or_else(|| Hits::new(&self.scene, &self.camera));
        let view = self.view(sequence, &self.camera, &hits);
        self.hits = Some(hits);
        Some(view)
    }

    fn view(&self, sequence: u64, camera: &Camera, hits: &Hits) -> View {
        let materials = self.estimate.materials();
        let k = &self.camera.intrinsics;
        let full = |picture: Picture| {
            let same = (picture.width, picture.height) == (k.width, k.height);
            Arc::new(if same {
                picture
            } else {
                repeat(&picture, k.width, k.height)
            })
        };
        let sharp = (camera.intrinsics.width, camera.intrinsics.height) == (k.width, k.height);
        View {
            sequence,
            frame: self.frame,
            photograph: self.photograph.clone(),
            render: None,
            samples: 0,
            albedo: Some(full(hits.albedo(&self.scene, &materials))),
            emission: Some(full(hits.emission(&self.scene, camera, &self.estimate))),
            error: None,
            stderr: Some(full(hits.stderr(&self.scene, &self.estimate))),
            objects: sharp.then(|| Arc::new(hits.objects(&self.scene))),
        }
    }
}

/// Whether two estimates look different: a colour by more than 1 % of its range.
fn differs(a: &Estimate, b: &Estimate) -> bool {
    if a.objects.len() != b.objects.len() || a.outside != b.outside {
        return true;
    }
    let texels = |e: &Estimate| e.texels.as_ref().map(Arc::as_ptr);
    if texels(a) != texels(b) {
        return true;
    }
    let brightest = (a.objects.iter().chain(&b.objects))
        .map(|o| o.emission.max_element())
        .fold(0.0f32, f32::max);
    let apart = |a: Vec3, b: Vec3, scale: f32| (a - b).abs().max_element() > VISIBLE * scale;
    a.objects.iter().zip(&b.objects).any(|(a, b)| {
        apart(a.albedo, b.albedo, 1.0)
            || apart(a.emission, b.emission, brightest)
            || (a.roughness, a.specular) != (b.roughness, b.specular)
    })
}
