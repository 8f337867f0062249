//! Real spherical harmonics of second order.
