//! Open Image Denoise, loaded at run time if it is installed (Áfra 2019–2025, <https://www.openimagedenoise.org>).
//!
//! It is not linked: without it, [`super::denoise`] is used. `RELIT_OIDN` names its file if the system does not find it.

use crate::math::picture::Picture;
use crate::transport::guide::Guide;
use glam::Vec3;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::null;
use std::sync::{LazyLock, Mutex};

/// `OIDN_DEVICE_TYPE_CPU`, for equal results on all machines.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;
/// File names of the library, version 2.
const NAMES: [&str; 4] = [
    "libOpenImageDenoise.so.2",
    "libOpenImageDenoise.so",
    "libOpenImageDenoise.2.dylib",
    "OpenImageDenoise.dll",
];

type Handle = *mut c_void;

/// The used functions of the library, with the types of its header `oidn.h`.
struct Functions {
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(
        Handle,
        *const c_char,
        *mut c_void,
        c_int,
        usize,
        usize,
        usize,
        usize,
        usize,
    ),
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
    error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
}

/// The library with a device on which filters run.
pub struct Oidn {
    functions: Functions,
    /// One filter runs at a time: each takes all threads.
    device: Mutex<Device>,
    /// Keeps the functions' code loaded.
    _library: Library,
}

struct Device(Handle);

// SAFETY: a device may be used from any thread, one at a time, which the mutex around it ensures.
#[allow(unsafe_code, reason = "the library's handle is a raw pointer")]
unsafe impl Send for Device {}

static FOUND: LazyLock<Option<Oidn>> = LazyLock::new(|| {
    let named = std::env::var_os("RELIT_OIDN").map(|file| file.to_string_lossy().into_owned());
    let names = match &named {
        Some(file) => vec![file.as_str()],
        None => NAMES.to_vec(),
    };
    names.into_iter().find_map(Oidn::load)
});

/// The library, if it is installed; loaded at the first call.
pub fn found() -> Option<&'static Oidn> {
    FOUND.as_ref()
}

impl Oidn {
    /// Loads the library from a file or by its name.
    #[allow(unsafe_code, reason = "a foreign library")]
    fn load(name: &str) -> Option<Self> {
        // SAFETY: loading runs the library's initialisers, and the types of the functions are those of version 2 of its header.
        unsafe {
            let library = Library::new(name).ok()?;
            let new_device: unsafe extern "C" fn(c_int) -> Handle =
                *library.get(b"oidnNewDevice\0").ok()?;
            let commit_device: unsafe extern "C" fn(Handle) =
                *library.get(b"oidnCommitDevice\0").ok()?;
            let functions = Functions {
                new_filter: *library.get(b"oidnNewFilter\0").ok()?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0").ok()?,
                set_bool: *library.get(b"oidnSetFilterBool\0").ok()?,
                commit_filter: *library.get(b"oidnCommitFilter\0").ok()?,
                execute: *library.get(b"oidnExecuteFilter\0").ok()?,
                release_filter: *library.get(b"oidnReleaseFilter\0").ok()?,
                error: *library.get(b"oidnGetDeviceError\0").ok()?,
            };
            let device = new_device(CPU);
            if device.is_null() {
                return None;
            }
            commit_device(device);
            let oidn = Self {
                functions,
                device: Mutex::new(Device(device)),
                _library: library,
            };
            let failed = (oidn.functions.error)(device, &mut null()) != 0;
            (!failed).then_some(oidn)
        }
    }

    /// Denoises a picture of radiance, guided by albedo and normal; `guides` has one entry per pixel.
    ///
    /// # Errors
    /// The library's message, or guides are missing.
    #[allow(unsafe_code, reason = "a foreign library")]
    pub fn denoise(&self, noisy: &Picture, guides: &[Option<Guide>]) -> Result<Picture, String> {
        let feature = |value: &dyn Fn(&Guide) -> Vec3| -> Vec<Vec3> {
            (guides.iter().map(|g| g.as_ref().map_or(Vec3::ZERO, value))).collect()
        };
        // Emission is added to albedo, so that lamps have edges in it.
        let mut albedo = feature(&|g| (g.albedo + g.emission).min(Vec3::ONE));
        let mut normal = feature(&|g| g.normal);
        let mut color = noisy.pixels.clone();
        let mut output = color.clone();
        let images: [(&CStr, &mut Vec<Vec3>); 4] = [
            (c"color", &mut color),
            (c"albedo", &mut albedo),
            (c"normal", &mut normal),
            (c"output", &mut output),
        ];
        let (width, height) = (noisy.width as usize, noisy.height as usize);
        if images
            .iter()
            .any(|(_, image)| image.len() != width * height)
        {
            return Err("a guide is missing for some pixels".to_owned());
        }
        let device = (self.device.lock()).map_err(|_| "an earlier call failed".to_owned())?;
        let call = &self.functions;
        // SAFETY: all images have width × height pixels of three f32 (Vec3 is repr(C)) and live until the filter is released.
        unsafe {
            let filter = (call.new_filter)(device.0, c"RT".as_ptr());
            for (name, image) in images {
                let pixels = image.as_mut_ptr().cast();
                (call.set_image)(
                    filter,
                    name.as_ptr(),
                    pixels,
                    FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
            (call.set_bool)(filter, c"hdr".as_ptr(), true);
            (call.commit_filter)(filter);
            (call.execute)(filter);
            (call.release_filter)(filter);
            let mut message = null();
            if (call.error)(device.0, &mut message) != 0 {
                return Err(match message.is_null() {
                    true => "an unnamed error".to_owned(),
                    false => CStr::from_ptr(message).to_string_lossy().into_owned(),
                });
            }
        }
        Ok(Picture {
            pixels: output,
            ..*noisy
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    #[test]
    fn noise_goes_and_the_mean_stays_where_the_library_is_installed() {
        let Some(oidn) = found() else {
            eprintln!("skipped: Open Image Denoise is not installed; RELIT_OIDN names its library");
            return;
        };
        let (width, height) = (64, 48);
        let truth = |x: u32| if x < width / 2 { 0.2 } else { 0.8 };
        let mut pixel = 0;
        let noisy = Picture::from_fn(width, height, |_, _| {
            let noise = 2.0 * Stream::new(1, 0, pixel, 0).uniform2()[0];
            pixel += 1;
            Vec3::splat(truth((pixel - 1) as u32 % width) * noise)
        });
        let guides: Vec<Option<Guide>> = (0..width * height)
            .map(|pixel| {
                Some(Guide {
                    point: Vec3::ZERO,
                    normal: Vec3::Z,
                    depth: 1.0,
                    albedo: Vec3::splat(truth(pixel % width)),
                    emission: Vec3::ZERO,
                    object: 0,
                })
            })
            .collect();
        let smooth = oidn.denoise(&noisy, &guides).expect("it denoises");
        let errors = smooth.pixels.iter().enumerate();
        let errors: Vec<f32> = errors
            .map(|(pixel, value)| value.x / truth(pixel as u32 % width) - 1.0)
            .collect();
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        let square = errors.iter().map(|e| e * e).sum::<f32>() / errors.len() as f32;
        assert!(mean.abs() < 0.02, "{mean}");
        // Noise of a uniform number has a variance of a third.
        assert!(square < 0.01, "{square}");
        assert!(oidn.denoise(&noisy, &guides[1..]).is_err());
    }
}
