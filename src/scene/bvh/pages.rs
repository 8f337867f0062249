//! Large arrays on huge pages: random access to many megabytes is otherwise limited by address translation.

use bytemuck::Pod;
use memmap2::MmapMut;
use std::ops::{Deref, Range};

/// Size of a huge page on x86-64 and on most Arm systems.
const PAGE: usize = 2 << 20;

/// An array of fixed length, on huge pages if the system has them.
pub(super) enum Pages<T> {
    /// Too small to benefit, or mapping failed.
    Small(Vec<T>),
    /// A mapping and the byte range of the array in it, aligned to [`PAGE`].
    Large(MmapMut, Range<usize>),
}

impl<T: Pod> Pages<T> {
    pub fn new(items: Vec<T>) -> Self {
        let length = size_of_val(items.as_slice());
        if length < PAGE {
            return Self::Small(items);
        }
        let Ok(mut map) = MmapMut::map_anon(length + PAGE) else {
            return Self::Small(items);
        };
        // The advice may be refused: small pages are only slower.
        #[cfg(target_os = "linux")]
        let _ = map.advise(memmap2::Advice::HugePage);
        let start = map.as_ptr().align_offset(PAGE);
        let bytes = start..start + length;
        map[bytes.clone()].copy_from_slice(bytemuck::cast_slice(&items));
        Self::Large(map, bytes)
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match self {
            Self::Small(items) => items,
            Self::Large(map, bytes) => bytemuck::cast_slice(&map[bytes.clone()]),
        }
    }
}
