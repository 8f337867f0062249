//! A view being rendered.

use crate::capture::photograph::Photograph;
use crate::gpu::Tracer;
use crate::inverse::estimate::Estimate;
use crate::math::picture::Picture;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::command::{ViewCamera, ViewRequest};
use crate::session::open_capture::OpenCapture;
use crate::session::snapshot::{LightLayers, View};
use crate::session::view::hits::Hits;
use crate::session::view::progressive::{MAX_SAMPLES, Progressive};
use crate::session::view::sized::box_filter;
use crate::transport::denoise::{Denoiser, Guide, guides};
use crate::transport::layers::Split;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::Vec3;
use std::sync::Arc;

/// Smallest visible change of a colour, relative to its range.
const VISIBLE: f32 = 0.01;
/// A new render replaces one with this many samples only when it has as many; also for renders with more.
const MIN_REPLACEMENT_SAMPLES: u32 = 8;
/// Longest side in pixels of a view with layers by lamp; limits their memory.
const LAYERED_LONG_SIDE: u32 = 768;

/// A camera's pictures, from coarse to fine.
#[derive(Debug)]
pub struct Target {
    scene: Arc<Scene>,
    frame: Option<usize>,
    camera: Camera,
    estimate: Arc<Estimate>,
    photograph: Option<Arc<Picture>>,
    /// Saturation of the photograph's channels.
    saturation: Vec3,
    /// The camera of the coarse first picture, until it is rendered.
    coarse: Option<Camera>,
    hits: Option<Hits>,
    world: LitScene,
    render: Progressive,
    /// The scene on the graphics card.
    tracer: Option<Tracer>,
    /// The newest complete render, and its samples per pixel.
    rendered: Option<(Arc<Picture>, u32)>,
    /// Whether the render is shown.
    watched: bool,
    /// Samples that a render must have before it replaces the shown one.
    hold: u32,
    guides: Option<Vec<Option<Guide>>>,
    /// The same render by lamp, if requested.
    layers: Option<Arc<LightLayers>>,
    /// Pictures of albedo, emission and standard error.
    maps: [Option<Arc<Picture>>; 3],
    objects: Option<Arc<Vec<u32>>>,
    /// Whether these pictures are older than the estimate.
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
        let long_side = match request.layers {
            true => request.long_side.min(LAYERED_LONG_SIDE),
            false => request.long_side,
        };
        let camera = camera.shrunk(long_side);
        let taken = frame.and_then(|frame| capture.photographs.get(frame));
        let k = &camera.intrinsics;
        let sized = |taken: &Arc<Photograph>| box_filter(&taken.picture(), k.width, k.height);
        let photograph = taken.map(|taken| Arc::new(sized(taken)));
        let coarse = camera.shrunk(first_long_side);
        let world = estimate.lit(&scene);
        let split = request.layers.then(|| Arc::new(Split::new(&world)));
        Some(Self {
            render: Progressive::new(&camera, split),
            world,
            tracer: None,
            rendered: None,
            watched: request.render || request.layers,
            hold: 0,
            guides: None,
            layers: None,
            maps: [const { None }; 3],
            objects: None,
            scene,
            frame,
            camera,
            estimate: estimate.clone(),
            photograph,
            saturation: taken.map_or(Vec3::INFINITY, |taken| taken.saturation),
            coarse: Some(coarse),
            hits: None,
            stale: true,
        })
    }

    /// Switches to another estimate if it is visibly different.
    pub fn follow(&mut self, estimate: &Arc<Estimate>) {
        if !Arc::ptr_eq(&self.estimate, estimate) && differs(&self.estimate, estimate) {
            self.adopt(estimate);
            self.render.fade();
        }
    }

    /// Switches to another estimate and drops all samples; the old render is shown until the new one is as good.
    pub fn start_over(&mut self, estimate: &Arc<Estimate>) {
        self.adopt(estimate);
        self.render.clear();
        let shown = self.rendered.as_ref().map_or(0, |(_, samples)| *samples);
        self.hold = shown.min(MIN_REPLACEMENT_SAMPLES);
    }

    fn adopt(&mut self, estimate: &Arc<Estimate>) {
        self.estimate = estimate.clone();
        self.world = estimate.lit(&self.scene);
        self.tracer = None;
        self.guides = None;
        self.stale = true;
        // With other lamps the layers are others.
        if let Some(split) = &self.render.split {
            let now = Split::new(&self.world);
            if now != **split {
                self.render = Progressive::new(&self.camera, Some(Arc::new(now)));
            }
        }
    }

    pub fn is_done(&self) -> bool {
        let sharp = !self.watched || self.render.samples() >= MAX_SAMPLES;
        self.coarse.is_none() && !self.stale && sharp
    }

    /// Whether the first complete picture is still missing.
    pub fn is_rough(&self) -> bool {
        self.hits.is_none() || (self.watched && self.render.samples() == 0)
    }

    /// Renders the next slice. Returns the pictures if one of them changed.
    pub fn sharpen(
        &mut self,
        renderer: &Renderer,
        options: &PathOptions,
        sequence: u64,
    ) -> Option<View> {
        if let Some(coarse) = self.coarse.take() {
            self.sketch(&coarse, options);
        } else if self.stale {
            self.stale = false;
            let hits = self.hits.take();
            let hits = hits.unwrap_or_else(|| Hits::new(&self.scene, &self.camera));
            self.map(&hits, &self.camera.clone());
            self.objects = Some(Arc::new(hits.objects(&self.scene)));
            self.hits = Some(hits);
        } else if self.is_done() || !self.sample(renderer, options) {
            return None;
        } else {
            let samples = self.render.samples();
            // Denoising takes longer than a sample, so it is done when the samples have doubled.
            let split = self.render.split.is_some();
            let doubled = samples.is_power_of_two() && samples > 1;
            if samples < self.hold || !(split || doubled) {
                return None;
            }
            self.hold = 0;
            let smoothed = self.smoothed();
            let picture = self.exposed(smoothed, false);
            self.layers = self.layers_of(&self.render, &self.camera);
            self.rendered = Some((Arc::new(picture), samples));
        }
        Some(self.view(sequence))
    }

    /// Renders a pass on the graphics card, or else some rows. Returns whether a pass is complete.
    fn sample(&mut self, renderer: &Renderer, options: &PathOptions) -> bool {
        let (render, camera) = (&mut self.render, &self.camera);
        if render.split.is_none() && render.is_between_passes() {
            if self.tracer.is_none() {
                self.tracer = renderer.tracer(&self.world, &[]);
            }
            let pass = |render: &mut Progressive, tracer: &mut Tracer| {
                render.add_on(tracer, camera, options)
            };
            if (renderer.on_card(render, &mut self.tracer, pass)).is_some() {
                return true;
            }
        }
        render.add(&self.world, camera, options)
    }

    /// The mean of all samples; denoised if there are two halves.
    fn smoothed(&mut self) -> Picture {
        let Some([a, b]) = self.render.halves(&self.camera) else {
            return self.render.picture(&self.camera);
        };
        let seen = || guides(&self.world, &self.camera);
        Denoiser::best().denoise(&a, &b, self.guides.get_or_insert_with(seen))
    }

    /// Renders coarse versions of all pictures.
    fn sketch(&mut self, coarse: &Camera, options: &PathOptions) {
        let hits = Hits::new(&self.scene, coarse);
        self.map(&hits, coarse);
        let mut render = Progressive::new(coarse, self.render.split.clone());
        while !render.add(&self.world, coarse, options) {}
        self.layers = self.layers_of(&render, coarse);
        let picture = self.enlarged(self.exposed(render.picture(coarse), false));
        self.rendered = Some((picture, 1));
    }

    /// The layers of a render by lamp, in exposed light, at the size of the shown pictures.
    fn layers_of(&self, render: &Progressive, camera: &Camera) -> Option<Arc<LightLayers>> {
        let split = render.split.as_ref()?;
        let pictures = render.layer_pictures(camera).into_iter();
        let shown = pictures.map(|picture| self.enlarged(self.exposed(picture, true)));
        Some(Arc::new(LightLayers {
            layers: split.sources().iter().copied().zip(shown).collect(),
            samples: render.samples(),
        }))
    }

    fn map(&mut self, hits: &Hits, camera: &Camera) {
        let stderr = hits.stderr(&self.scene, &self.estimate);
        let maps = [
            hits.albedo(&self.scene, &self.world.materials),
            hits.emission(&self.scene, camera, &self.estimate),
            hits.mark_unseen(stderr, &self.scene, &self.estimate),
        ];
        self.maps = maps.map(|picture| Some(self.enlarged(picture)));
    }

    /// Converts radiance to the values of the frame's photograph; where `linear`, to the exposed light before the camera's
    /// response, in which lamps add up.
    fn exposed(&self, mut radiance: Picture, linear: bool) -> Picture {
        if let Some(frame) = self.frame {
            let mut exposure = self.estimate.exposure(frame);
            exposure.response = exposure.response.filter(|_| !linear);
            exposure.apply(&self.camera.intrinsics, self.saturation, &mut radiance);
        }
        radiance
    }

    fn enlarged(&self, picture: Picture) -> Arc<Picture> {
        let k = &self.camera.intrinsics;
        if (picture.width, picture.height) == (k.width, k.height) {
            return Arc::new(picture);
        }
        Arc::new(picture.enlarged(k.width, k.height))
    }

    fn view(&self, sequence: u64) -> View {
        let [albedo, emission, stderr] = self.maps.clone();
        let (render, samples) = self.rendered.clone().unzip();
        let both = render.as_ref().zip(self.photograph.as_ref());
        let error = both.map(|(render, taken)| Arc::new(difference(render, taken)));
        View {
            sequence,
            frame: self.frame,
            photograph: self.photograph.clone(),
            render,
            samples: samples.unwrap_or(0),
            albedo,
            emission,
            error,
            stderr,
            objects: self.objects.clone(),
            layers: self.layers.clone(),
        }
    }
}

/// Render − photograph, signed.
pub fn difference(render: &Picture, photograph: &Picture) -> Picture {
    let pixels = render.pixels.iter().zip(&photograph.pixels);
    Picture {
        pixels: pixels.map(|(r, p)| *r - *p).collect(),
        ..*photograph
    }
}

/// Whether two estimates are visibly different: a colour by more than 1 % of its range.
pub fn differs(a: &Estimate, b: &Estimate) -> bool {
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
    let differ = |a: Vec3, b: Vec3, scale: f32| (a - b).abs().max_element() > VISIBLE * scale;
    a.objects.iter().zip(&b.objects).any(|(a, b)| {
        differ(a.albedo, b.albedo, 1.0)
            || differ(a.emission, b.emission, brightest)
            || (a.roughness, a.specular) != (b.roughness, b.specular)
    })
}
