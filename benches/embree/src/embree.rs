//! The few functions of Embree 3 that are compared with, by its C interface (libembree-dev).

use glam::Vec3;
use relit::scene::geometry::Ray;
use std::ffi::{CString, c_char, c_void};
use std::ptr::null_mut;

const GEOMETRY_TYPE_TRIANGLE: i32 = 0;
const BUFFER_TYPE_INDEX: i32 = 0;
const BUFFER_TYPE_VERTEX: i32 = 1;
const FORMAT_UINT3: i32 = 0x5003;
const FORMAT_FLOAT3: i32 = 0x9003;
const SCENE_FLAG_ROBUST: i32 = 1 << 2;
const INVALID: u32 = u32::MAX;

/// Struct RTCRayHit of Embree 3.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct RayHit {
    origin: [f32; 3],
    near: f32,
    direction: [f32; 3],
    time: f32,
    pub far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    u: f32,
    v: f32,
    pub primitive: u32,
    geometry: u32,
    instance: u32,
}

impl RayHit {
    pub fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            near: ray.t_min,
            direction: ray.direction.to_array(),
            time: 0.0,
            far: ray.t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: INVALID,
            geometry: INVALID,
            instance: INVALID,
        }
    }
}

/// Struct RTCIntersectContext; the flags say that rays are incoherent.
#[repr(C)]
struct Context {
    flags: i32,
    filter: *mut c_void,
    instance: [u32; 1],
}

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const c_char) -> *mut c_void;
    fn rtcNewScene(device: *mut c_void) -> *mut c_void;
    fn rtcSetSceneFlags(scene: *mut c_void, flags: i32);
    fn rtcSetSceneBuildQuality(scene: *mut c_void, quality: i32);
    fn rtcNewGeometry(device: *mut c_void, kind: i32) -> *mut c_void;
    fn rtcSetGeometryBuildQuality(geometry: *mut c_void, quality: i32);
    fn rtcSetNewGeometryBuffer(
        geometry: *mut c_void,
        kind: i32,
        slot: u32,
        format: i32,
        stride: usize,
        count: usize,
    ) -> *mut c_void;
    fn rtcCommitGeometry(geometry: *mut c_void);
    fn rtcAttachGeometry(scene: *mut c_void, geometry: *mut c_void) -> u32;
    fn rtcCommitScene(scene: *mut c_void);
    fn rtcIntersect1(scene: *mut c_void, context: *mut Context, hit: *mut RayHit);
    fn rtcOccluded1(scene: *mut c_void, context: *mut Context, ray: *mut RayHit);
}

/// Build quality and whether the robust (watertight) traversal is asked for.
#[derive(Clone, Copy)]
pub struct Quality {
    pub high: bool,
    pub robust: bool,
}

pub struct Embree {
    scene: *mut c_void,
}

impl Embree {
    /// `config` as for `rtcNewDevice`.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]], quality: Quality, config: &str) -> Self {
        let config = CString::new(config).expect("no NUL");
        let build_quality = if quality.high { 2 } else { 1 };
        // SAFETY: the calls follow the manual's order; both buffers are filled with the counts asked for.
        unsafe {
            let device = rtcNewDevice(config.as_ptr());
            let scene = rtcNewScene(device);
            if quality.robust {
                rtcSetSceneFlags(scene, SCENE_FLAG_ROBUST);
            }
            rtcSetSceneBuildQuality(scene, build_quality);
            let geometry = rtcNewGeometry(device, GEOMETRY_TYPE_TRIANGLE);
            rtcSetGeometryBuildQuality(geometry, build_quality);
            let vertices = rtcSetNewGeometryBuffer(
                geometry,
                BUFFER_TYPE_VERTEX,
                0,
                FORMAT_FLOAT3,
                12,
                positions.len(),
            );
            std::ptr::copy_nonoverlapping(positions.as_ptr(), vertices.cast(), positions.len());
            let indices = rtcSetNewGeometryBuffer(
                geometry,
                BUFFER_TYPE_INDEX,
                0,
                FORMAT_UINT3,
                12,
                triangles.len(),
            );
            std::ptr::copy_nonoverlapping(triangles.as_ptr(), indices.cast(), triangles.len());
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(scene, geometry);
            rtcCommitScene(scene);
            Self { scene }
        }
    }

    /// Distance and triangle of the nearest hit.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<(f32, u32)> {
        let mut hit = RayHit::new(ray);
        // SAFETY: the scene is committed; ray and context live on the stack with Embree's layout.
        unsafe { rtcIntersect1(self.scene, &mut Context::incoherent(), &mut hit) };
        (hit.geometry != INVALID).then_some((hit.far, hit.primitive))
    }

    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut hit = RayHit::new(ray);
        // SAFETY: as above; `rtcOccluded1` touches only the ray at the start of the struct.
        unsafe { rtcOccluded1(self.scene, &mut Context::incoherent(), &mut hit) };
        hit.far < 0.0
    }
}

impl Context {
    fn incoherent() -> Self {
        Self {
            flags: 0,
            filter: null_mut(),
            instance: [INVALID],
        }
    }
}
