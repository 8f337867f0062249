//! A picture of the shown view, made ready to be drawn from what the worker sent.

use crate::app::document::Document;
use crate::app::picture::irradiance::Irradiance;
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::picture::ramp::{self, Scales};
use crate::app::shown::Shown;
use crate::session::snapshot::Picture;
use std::cell::RefCell;
use std::sync::Arc;

/// A picture to draw.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// What it is.
    pub quantity: Quantity,
    /// Its numbers.
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

/// What the window derives from the worker's pictures, kept until those change.
#[derive(Debug, Default)]
pub struct Derived {
    /// The irradiance of the shown view.
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
            Quantity::Irradiance => self.irradiance.picture(),
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
}
