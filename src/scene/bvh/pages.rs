//! Large arrays on large pages: random access to many megabytes is otherwise bound by address translation.

use bytemuck::Pod;
use memmap2::MmapMut;
use std::ops::{Deref, Range};

/// Size of a large page on x86-64 and on most Arm systems.
const PAGE: usize = 2 << 20;

/// An array that never grows, on large pages where the system has them.
pub(super) enum Pages<T> {
    /// Too small to gain, or the system gave no mapping.
    Small(Vec<T>),
    /// The bytes of a mapping that hold the array, from a multiple of [`PAGE`] on.
    Large(MmapMut, Range<usize>),
}

impl<T: Pod> Pages<T> {
    /// Moves a vector.
    pub fn new(items: Vec<T>) -> Self {
        let length = size_of_val(items.as_slice());
        if length < PAGE {
            return Self::Small(items);
        }
        let Ok(mut map) = MmapMut::map_anon(length + PAGE) else {
            return Self::Small(items);
        };
        // Small pages do as well, only slower: a system that refuses the advice is no error.
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
