//! Pictures of the shown view, made ready to be drawn from what the worker sent; also the light that arrives at what each pixel
//! sees, from what it sends and what it reflects.

use crate::app::document::Document;
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::picture::ramp::{self, Scales};
use crate::app::shown::Shown;
use crate::session::snapshot::{Picture, View};
use glam::Vec3;
use std::cell::RefCell;
use std::f32::consts::PI;
use std::sync::Arc;

/// A picture to draw.
#[derive(Debug, Clone)]
pub struct Drawn {
    pub quantity: Quantity,
    pub picture: Arc<Picture>,
    /// Object index of each of its pixels, where known.
    pub objects: Option<Arc<Vec<u32>>>,
    /// Magnitude at the end of false colours.
    pub range: f32,
}

impl Drawn {
    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.picture.width, self.picture.height]
    }
}

/// The objects that the pixels of a view show, for a picture of the same view in another size; made once for each view.
#[derive(Debug, Default)]
pub struct Resized(Option<(Indices, [u32; 2], Indices)>);

/// An object's index for each pixel of a picture.
type Indices = Arc<Vec<u32>>;

impl Resized {
    fn of(&mut self, objects: &Indices, from: [u32; 2], to: [u32; 2]) -> Option<Indices> {
        if objects.len() as u64 != u64::from(from[0]) * u64::from(from[1]) {
            return None;
        }
        let known = self.0.as_ref();
        if let Some((_, _, made)) = known.filter(|k| Arc::ptr_eq(&k.0, objects) && k.1 == to) {
            return Some(made.clone());
        }
        let at = |i: u32, axis: usize| {
            (u64::from(i) * u64::from(from[axis]) / u64::from(to[axis].max(1))) as usize
        };
        let row = |y: u32| (0..to[0]).map(move |x| objects[at(y, 1) * from[0] as usize + at(x, 0)]);
        let made = Arc::new((0..to[1]).flat_map(row).collect::<Vec<u32>>());
        self.0 = Some((objects.clone(), to, made.clone()));
        Some(made)
    }
}

/// Albedos below this tell nothing of the light that arrives.
const DARKEST: f32 = 0.01;

/// The picture of a view's irradiance, made anew when the view's pictures change: after the render and the albedo that it was
/// made of.
#[derive(Debug, Default)]
pub struct Irradiance(Option<[Arc<Picture>; 3]>);

impl Irradiance {
    /// Follows the pictures of a view; forgets all where there is none.
    pub fn update(&mut self, view: Option<&View>) {
        let parts = view.and_then(|view| {
            let (render, albedo) = (view.render.as_ref()?, view.albedo.as_ref()?);
            Some((render, albedo, view.emission.as_ref()?))
        });
        let Some((render, albedo, emission)) = parts else {
            self.0 = None;
            return;
        };
        let current = |[r, a, _]: &[_; 3]| Arc::ptr_eq(r, render) && Arc::ptr_eq(a, albedo);
        if !self.0.as_ref().is_some_and(current) {
            let picture = Arc::new(irradiance(render, albedo, emission));
            self.0 = Some([render.clone(), albedo.clone(), picture]);
        }
    }
}

/// E = π (L − Le) / ρ of diffuse surfaces, W·m⁻²; zero where the surface reflects next to nothing.
fn irradiance(render: &Picture, albedo: &Picture, emission: &Picture) -> Picture {
    let pixels = render.pixels.iter().zip(&albedo.pixels);
    let pixels = pixels.zip(&emission.pixels);
    let arriving = pixels.map(|((render, albedo), emission)| {
        let known = albedo.cmpgt(Vec3::splat(DARKEST));
        let light = (*render - *emission).max(Vec3::ZERO) * PI / albedo.max(Vec3::splat(DARKEST));
        Vec3::select(known, light, Vec3::ZERO)
    });
    Picture {
        pixels: arriving.collect(),
        ..*render
    }
}

/// What the window derives from the worker's pictures, kept until those change.
#[derive(Debug, Default)]
pub struct Derived {
    pub irradiance: Irradiance,
    /// The chosen photograph, there before the worker has sent anything of its view.
    photograph: Option<(usize, Arc<Picture>)>,
    resized: RefCell<Resized>,
    scales: RefCell<Scales>,
}

impl Derived {
    /// Makes a picture of the chosen photograph.
    pub fn convert_photograph(&mut self, document: &Document, frame: usize) {
        if !matches!(&self.photograph, Some((known, _)) if *known == frame) {
            let open = document.capture();
            let photograph = open.and_then(|open| open.photographs.get(frame));
            self.photograph = photograph.map(|p| (frame, Arc::new(p.picture())));
        }
    }

    fn photograph(&self, shown: &Shown) -> Option<Arc<Picture>> {
        let (frame, picture) = self.photograph.as_ref()?;
        (shown.photograph() == Some(*frame)).then(|| picture.clone())
    }

    /// A picture of the shown view; the photograph as large as its composite where `sized`.
    pub fn drawn(
        &self,
        document: &Document,
        shown: &Shown,
        sized: bool,
        quantity: Quantity,
    ) -> Option<Drawn> {
        let view = shown.view(document);
        let insertion = shown.insertion(document);
        let picture = match quantity {
            Quantity::Photograph => (insertion.filter(|_| sized))
                .map(|insertion| insertion.photograph.clone())
                .or_else(|| view?.photograph.clone())
                .or_else(|| self.photograph(shown)),
            Quantity::Render => view?.render.clone(),
            Quantity::Albedo => view?.albedo.clone(),
            Quantity::Emission => view?.emission.clone(),
            Quantity::Irradiance => self.irradiance.0.as_ref().map(|[.., made]| made.clone()),
            Quantity::Error => view?.error.clone(),
            Quantity::StandardError => view?.stderr.clone(),
            Quantity::Naive => insertion.map(|insertion| insertion.naive.clone()),
            Quantity::NaiveEstimate => insertion.map(|insertion| insertion.naive_estimate.clone()),
            Quantity::Composite => insertion
                .map(|insertion| insertion.composite.clone())
                .or_else(|| self.photograph(shown)),
        }?;
        let range = match quantity.shading() {
            Shading::Signed | Shading::Positive => {
                let now = ramp::range(&picture, quantity.shading());
                self.scales.borrow_mut().follow(quantity, now)
            }
            _ => 1.0,
        };
        let objects = view.and_then(|view| {
            let (objects, seen) = (view.objects.as_ref()?, view.albedo.as_ref()?);
            let from = [seen.width, seen.height];
            let to = [picture.width, picture.height];
            match from == to {
                true => Some(objects.clone()),
                false => self.resized.borrow_mut().of(objects, from, to),
            }
        });
        Some(Drawn {
            quantity,
            picture,
            objects,
            range,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_told_in_a_picture_of_another_size() {
        let objects = Arc::new(vec![0, 1, 2, 3]);
        let mut resized = Resized::default();
        let large = resized.of(&objects, [2, 2], [4, 2]).expect("made");
        assert_eq!(*large, [0, 0, 1, 1, 2, 2, 3, 3]);
        let again = resized.of(&objects, [2, 2], [4, 2]).expect("made");
        assert!(Arc::ptr_eq(&large, &again));
        assert!(resized.of(&objects, [3, 2], [4, 2]).is_none());
    }

    #[test]
    fn light_that_is_reflected_arrived_and_a_lamps_own_did_not() {
        let flat = |value: Vec3| Picture::from_fn(2, 1, |_, _| value);
        let albedo = flat(Vec3::new(0.5, 0.25, 0.0));
        // A wall of 0.5 that sends 1/π receives 2.
        let sent = Vec3::splat(1.0 / PI);
        let wall = irradiance(&flat(sent), &albedo, &flat(Vec3::ZERO));
        assert!((wall.pixels[1] - Vec3::new(2.0, 4.0, 0.0)).length() < 1e-5);
        let lamp = irradiance(&flat(sent), &albedo, &flat(sent));
        assert_eq!(lamp.pixels[0], Vec3::ZERO);
    }
}
