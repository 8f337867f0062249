//! Mitsuba 3: an XML file, and a PLY file for each object in a folder beside it.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::part::Part;
use crate::export::ply::write_part;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{DMat3, DMat4, Vec3};
use std::fmt::Write;
use std::path::Path;

/// How the XML file begins.
const HEAD: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="-1"/></integrator>
"#;

/// Writes PATH, and the meshes into a folder named like PATH with "-meshes" for its extension.
///
/// Materials are two-sided: diffuse, or `principled` (roughness √α, specular F₀ / 0.08) with a specular lobe. Every
/// photograph's camera becomes a sensor, without its distortion.
///
/// # Errors
/// A file cannot be written.
pub fn write(path: &Path, scene: &Scene, parts: &[Part]) -> Result<()> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let folder = format!("{stem}-meshes");
    for (index, part) in parts.iter().enumerate() {
        let file = path.with_file_name(&folder).join(mesh_name(index, part));
        write_part(&file, part)?;
    }
    let mut xml = String::new();
    describe(&mut xml, scene, parts, &folder)
        .map_err(|error| Error::file(path, error, "nothing was written there"))?;
    write_bytes(path, xml.as_bytes())
}

fn mesh_name(index: usize, part: &Part) -> String {
    format!("{index:03}-{}.ply", part.plain_name())
}

fn describe(xml: &mut String, scene: &Scene, parts: &[Part], folder: &str) -> std::fmt::Result {
    xml.push_str(HEAD);
    for (index, camera) in scene.cameras.iter().enumerate() {
        sensor(xml, index, camera, scene)?;
    }
    for (index, part) in parts.iter().enumerate() {
        let file = format!("{folder}/{}", mesh_name(index, part));
        let [id, file] = [&part.name, &file].map(|text| escape(text));
        writeln!(xml, r#"  <shape type="ply" id="{id}">"#)?;
        writeln!(xml, r#"    <string name="filename" value="{file}"/>"#)?;
        writeln!(xml, r#"    <boolean name="face_normals" value="true"/>"#)?;
        bsdf(xml, part)?;
        if part.estimate.emission != Vec3::ZERO {
            let radiance = numbers(part.estimate.emission);
            let radiance = format!(r#"<rgb name="radiance" value="{radiance}"/>"#);
            writeln!(xml, r#"    <emitter type="area">{radiance}</emitter>"#)?;
        }
        writeln!(xml, "  </shape>")?;
    }
    writeln!(xml, "</scene>")
}

fn bsdf(xml: &mut String, part: &Part) -> std::fmt::Result {
    let lobe = part.estimate.lobe();
    let (kind, parameter) = match lobe {
        Some(_) => ("principled", "base_color"),
        None => ("diffuse", "reflectance"),
    };
    writeln!(xml, r#"    <bsdf type="twosided"><bsdf type="{kind}">"#)?;
    if part.colors.is_empty() {
        let albedo = numbers(part.estimate.albedo.clamp(Vec3::ZERO, Vec3::ONE));
        writeln!(xml, r#"      <rgb name="{parameter}" value="{albedo}"/>"#)?;
    } else {
        let name = r#"<string name="name" value="vertex_color"/>"#;
        let texture = format!(r#"<texture name="{parameter}" type="mesh_attribute">"#);
        writeln!(xml, "      {texture}{name}</texture>")?;
    }
    if let Some((alpha, specular)) = lobe {
        let (roughness, level) = (alpha.max(0.0).sqrt(), (specular / 0.08).clamp(0.0, 1.0));
        for (name, value) in [("roughness", roughness), ("specular", level)] {
            writeln!(xml, r#"      <float name="{name}" value="{value}"/>"#)?;
        }
    }
    writeln!(xml, "    </bsdf></bsdf>")
}

fn sensor(xml: &mut String, index: usize, camera: &Camera, scene: &Scene) -> std::fmt::Result {
    let lens = &camera.intrinsics;
    let (width, height) = (f64::from(lens.width), f64::from(lens.height));
    // Mitsuba's cameras look along +z with x to the left.
    let r = camera.rotation.as_dmat3();
    let center = camera.center.as_dvec3() + scene.origin;
    let axes = DMat3::from_cols(-r.x_axis, r.y_axis, -r.z_axis);
    let pose = DMat4::from_mat3_translation(axes, center).transpose();
    let matrix = pose.to_cols_array().map(|v| v.to_string()).join(" ");
    let field = 2.0 * (width * 0.5 / lens.fx).atan().to_degrees();
    let [x, y] = [0.5 - lens.cx / width, 0.5 - lens.cy / height];
    writeln!(
        xml,
        r#"  <sensor type="perspective" id="camera-{index:03}">
    <string name="fov_axis" value="x"/><float name="fov" value="{field}"/>
    <float name="principal_point_offset_x" value="{x}"/>
    <float name="principal_point_offset_y" value="{y}"/>
    <transform name="to_world"><matrix value="{matrix}"/></transform>
    <film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/><rfilter type="box"/></film>
  </sensor>"#
    )
}

fn numbers(color: Vec3) -> String {
    format!("{}, {}, {}", color.x, color.y, color.z)
}

/// Text for an XML attribute.
fn escape(text: &str) -> String {
    (text.replace(char::is_control, ""))
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
