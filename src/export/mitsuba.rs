//! Mitsuba 3: an XML file, and a PLY file for each object in a folder beside it.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::part::Part;
use crate::export::ply::write_part;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{DMat4, DVec4, Vec3};
use std::fmt::Write;
use std::path::Path;

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
    writeln!(
        xml,
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<scene version=\"3.0.0\">"
    )?;
    writeln!(
        xml,
        "  <integrator type=\"path\"><integer name=\"max_depth\" value=\"-1\"/></integrator>"
    )?;
    for (index, camera) in scene.cameras.iter().enumerate() {
        sensor(xml, index, camera, scene)?;
    }
    for (index, part) in parts.iter().enumerate() {
        let file = format!("{folder}/{}", mesh_name(index, part));
        writeln!(xml, "  <shape type=\"ply\" id=\"{}\">", escape(&part.name))?;
        writeln!(
            xml,
            "    <string name=\"filename\" value=\"{}\"/>",
            escape(&file)
        )?;
        writeln!(xml, "    <boolean name=\"face_normals\" value=\"true\"/>")?;
        bsdf(xml, part)?;
        if part.estimate.emission != Vec3::ZERO {
            let radiance = numbers(part.estimate.emission);
            writeln!(
                xml,
                "    <emitter type=\"area\"><rgb name=\"radiance\" value=\"{radiance}\"/></emitter>"
            )?;
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
    writeln!(xml, "    <bsdf type=\"twosided\"><bsdf type=\"{kind}\">")?;
    if part.colors.is_empty() {
        let albedo = numbers(part.estimate.albedo.clamp(Vec3::ZERO, Vec3::ONE));
        writeln!(xml, "      <rgb name=\"{parameter}\" value=\"{albedo}\"/>")?;
    } else {
        writeln!(
            xml,
            "      <texture name=\"{parameter}\" type=\"mesh_attribute\"><string name=\"name\" value=\"vertex_color\"/></texture>"
        )?;
    }
    if let Some((alpha, specular)) = lobe {
        let (roughness, level) = (alpha.max(0.0).sqrt(), (specular / 0.08).clamp(0.0, 1.0));
        writeln!(
            xml,
            "      <float name=\"roughness\" value=\"{roughness}\"/>"
        )?;
        writeln!(xml, "      <float name=\"specular\" value=\"{level}\"/>")?;
    }
    writeln!(xml, "    </bsdf></bsdf>")
}

fn sensor(xml: &mut String, index: usize, camera: &Camera, scene: &Scene) -> std::fmt::Result {
    let lens = &camera.intrinsics;
    let (width, height) = (f64::from(lens.width), f64::from(lens.height));
    // Mitsuba's cameras look along +z with x to the left.
    let [x, y, z] = [
        camera.rotation.x_axis,
        camera.rotation.y_axis,
        camera.rotation.z_axis,
    ]
    .map(|a| a.as_dvec3());
    let center = camera.center.as_dvec3() + scene.origin;
    let pose = DMat4::from_cols(
        (-x).extend(0.0),
        y.extend(0.0),
        (-z).extend(0.0),
        DVec4::from((center, 1.0)),
    );
    let rows: Vec<String> = pose
        .transpose()
        .to_cols_array()
        .map(|v| v.to_string())
        .to_vec();
    let field = 2.0 * (width * 0.5 / lens.fx).atan().to_degrees();
    writeln!(
        xml,
        "  <sensor type=\"perspective\" id=\"camera-{index:03}\">"
    )?;
    writeln!(
        xml,
        "    <string name=\"fov_axis\" value=\"x\"/><float name=\"fov\" value=\"{field}\"/>"
    )?;
    for (name, offset) in [("x", 0.5 - lens.cx / width), ("y", 0.5 - lens.cy / height)] {
        writeln!(
            xml,
            "    <float name=\"principal_point_offset_{name}\" value=\"{offset}\"/>"
        )?;
    }
    writeln!(
        xml,
        "    <transform name=\"to_world\"><matrix value=\"{}\"/></transform>",
        rows.join(" ")
    )?;
    writeln!(
        xml,
        "    <film type=\"hdrfilm\"><integer name=\"width\" value=\"{width}\"/><integer name=\"height\" value=\"{height}\"/><rfilter type=\"box\"/></film>"
    )?;
    writeln!(xml, "  </sensor>")
}

fn numbers(color: Vec3) -> String {
    format!("{}, {}, {}", color.x, color.y, color.z)
}

/// Text for an XML attribute.
fn escape(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .map(|c| match c {
            '&' => "&amp;".to_owned(),
            '<' => "&lt;".to_owned(),
            '>' => "&gt;".to_owned(),
            '"' => "&quot;".to_owned(),
            c => c.to_string(),
        })
        .collect()
}
