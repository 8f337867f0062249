//! What photographs tell about themselves before anything is solved: whether they are photographs of this mesh at all.

pub mod alignment;
pub mod photographs;
