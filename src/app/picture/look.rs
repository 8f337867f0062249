//! How pictures are looked at: exposure, tone curve, the zoom and cursor that all of them share, and which two are compared.

use crate::app::controls::choices;
use crate::app::picture::quantity::Quantity;
use egui::{Pos2, Rect, Vec2};

choices! {
    /// What becomes of radiance times exposure before the sRGB curve; numbered as in `picture.wgsl`.
    ToneCurve {
        None, "No tone curve", "Nothing: values above 1 clip";
        Reinhard, "Reinhard", "x / (1 + x) a channel (Reinhard et al. 2002)";
        Filmic, "Filmic", "A filmic shoulder and toe (Narkowicz's fit of the ACES curve, 2015)";
    }
}

/// A point of a picture in fractions of its width and height, so that pictures of other sizes agree on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    /// Fractions from the top left.
    pub at: Pos2,
    /// The picture that the pointer is in.
    pub over: Quantity,
}

/// The shared state of all pictures.
#[derive(Debug, Clone)]
pub struct Look {
    /// Exposure in stops: radiance is multiplied by 2 to this power.
    pub exposure: f32,
    /// Tone curve.
    pub tone: ToneCurve,
    /// The picture's point in the middle of a pane, in fractions of its size.
    pub center: Pos2,
    /// Magnification; 1 shows the whole picture.
    pub zoom: f32,
    /// Where the pointer is.
    pub cursor: Option<Cursor>,
    /// Whether every picture shows the photograph for as long as a key or button is down.
    pub photograph: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            exposure: 0.0,
            tone: ToneCurve::None,
            center: Pos2::new(0.5, 0.5),
            zoom: 1.0,
            cursor: None,
            photograph: false,
        }
    }
}

const MAX_ZOOM: f32 = 512.0;

impl Look {
    /// The picture that a pane shows now: the photograph in place of any other while that is held.
    pub fn held(&self, quantity: Quantity) -> Quantity {
        match self.photograph {
            true => Quantity::Photograph,
            false => quantity,
        }
    }

    /// Shows whole pictures.
    pub fn fit(&mut self) {
        self.center = Pos2::new(0.5, 0.5);
        self.zoom = 1.0;
    }

    /// Where a picture of `size` pixels lies when shown in `pane` (points); it may reach beyond it.
    pub fn placement(&self, pane: Rect, size: [u32; 2]) -> Rect {
        let size = Vec2::new(size[0].max(1) as f32, size[1].max(1) as f32);
        let fit = (pane.width() / size.x).min(pane.height() / size.y);
        let shown = size * fit.max(1e-6) * self.zoom;
        let corner = pane.center() - Vec2::new(self.center.x * shown.x, self.center.y * shown.y);
        Rect::from_min_size(corner, shown)
    }

    /// Zooms by `factor`, keeping the picture's point under `pointer` there.
    pub fn zoom_at(&mut self, pane: Rect, size: [u32; 2], pointer: Pos2, factor: f32) {
        let before = fraction(self.placement(pane, size), pointer);
        self.zoom = (self.zoom * factor).clamp(1.0, MAX_ZOOM);
        let after = fraction(self.placement(pane, size), pointer);
        self.center += before - after;
        self.keep_inside();
    }

    /// Moves the picture by `delta` points.
    pub fn pan(&mut self, pane: Rect, size: [u32; 2], delta: Vec2) {
        let shown = self.placement(pane, size).size();
        self.center -= Vec2::new(delta.x / shown.x, delta.y / shown.y);
        self.keep_inside();
    }

    fn keep_inside(&mut self) {
        let margin = 0.5 / self.zoom;
        let [low, high] = [margin, 1.0 - margin].map(|end| Pos2::new(end, end));
        self.center = self.center.clamp(low, high);
    }
}

/// A point's position in a rectangle, in fractions of its size.
pub fn fraction(rect: Rect, point: Pos2) -> Pos2 {
    let offset = point - rect.min;
    Pos2::new(offset.x / rect.width(), offset.y / rect.height())
}

choices! {
    /// How two pictures are compared.
    Mode {
        Wipe, "Wipe", "A line that can be dragged divides them";
        Flip, "Flip", "One at a time";
        SideBySide, "Side by side", "Both in full";
    }
}

/// The pictures compared, and how.
#[derive(Debug, Clone)]
pub struct Compare {
    /// The left or first picture.
    pub left: Quantity,
    /// The right or second picture.
    pub right: Quantity,
    /// How.
    pub mode: Mode,
    /// Where the wipe is, as a fraction of the pane's width.
    pub split: f32,
    /// What the photograph as it was changed is wiped against, in its own pane.
    pub against: Option<Quantity>,
}

impl Default for Compare {
    fn default() -> Self {
        Self {
            left: Quantity::Photograph,
            right: Quantity::Render,
            mode: Mode::Wipe,
            split: 0.5,
            against: None,
        }
    }
}

impl Compare {
    /// Swaps the two.
    pub fn flip(&mut self) {
        std::mem::swap(&mut self.left, &mut self.right);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zooming_keeps_the_point_under_the_pointer() {
        let pane = Rect::from_min_size(Pos2::new(30.0, 70.0), Vec2::new(400.0, 200.0));
        let mut look = Look::default();
        look.zoom_at(pane, [64, 48], pane.center(), 4.0);
        let pointer = pane.center() + Vec2::new(11.0, -23.0);
        let before = fraction(look.placement(pane, [64, 48]), pointer);
        look.zoom_at(pane, [64, 48], pointer, 3.0);
        let after = fraction(look.placement(pane, [64, 48]), pointer);
        assert!((before - after).length() < 1e-5);
        look.zoom_at(pane, [64, 48], pointer, 1e-9);
        assert_eq!((look.zoom, look.center), (1.0, Pos2::new(0.5, 0.5)));
    }

    #[test]
    fn a_picture_that_fits_touches_the_pane_on_two_sides() {
        let pane = Rect::from_min_size(Pos2::ZERO, Vec2::new(400.0, 200.0));
        let shown = Look::default().placement(pane, [64, 64]);
        assert_eq!(shown.size(), Vec2::new(200.0, 200.0));
        assert_eq!(shown.center(), pane.center());
    }

    #[test]
    fn panning_moves_the_picture_by_as_many_points() {
        let pane = Rect::from_min_size(Pos2::ZERO, Vec2::new(100.0, 100.0));
        let mut look = Look {
            zoom: 4.0,
            ..Look::default()
        };
        let before = look.placement(pane, [50, 50]).min;
        look.pan(pane, [50, 50], Vec2::new(7.0, -5.0));
        let moved = look.placement(pane, [50, 50]).min - before;
        assert!((moved - Vec2::new(7.0, -5.0)).length() < 1e-3);
    }
}
