//! The mesh on the graphics card: drawn with a depth buffer into a texture, and only when something has changed.

use crate::app::model::surface::Surface;
use crate::app::model::view::Colors;
use crate::app::picture::gpu::{
    bind, fill, float_texture, pipeline, texture, uniform_buffer, view,
};
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, RenderState, ScreenDescriptor};
use egui::PaintCallbackInfo;
use std::sync::Arc;
use wgpu::util::DeviceExt;

/// The uniform block of `mesh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SceneUniform {
    /// Scene to clip space, by columns.
    pub clip_from_scene: [[f32; 4]; 4],
    /// Centre of projection.
    pub eye: [f32; 3],
    pub exposure: f32,
    /// Colour of the selected object.
    pub accent: [f32; 4],
    pub background: [f32; 4],
    /// Index of the selected object, or −1.
    pub selected: f32,
    /// Whether exposure and tone curve apply.
    pub radiance: u32,
    /// Tone curve, as in `picture.wgsl`.
    pub tone: u32,
    /// Whether faces seen from behind are left out.
    pub cull: u32,
}

/// Draws the 3D view.
pub struct MeshPaint {
    pub surface: Arc<Surface>,
    pub colors: Colors,
    pub uniform: SceneUniform,
    /// Size in pixels.
    pub size: [u32; 2],
}

struct Meshes {
    mesh_pipeline: wgpu::RenderPipeline,
    screen_pipeline: wgpu::RenderPipeline,
    uniform: wgpu::Buffer,
    corners: Option<(Arc<Surface>, wgpu::Buffer)>,
    colors: Option<(Colors, wgpu::BindGroup)>,
    target: Option<Target>,
}

/// The picture drawn into, and what it shows.
struct Target {
    size: [u32; 2],
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
    bind_group: wgpu::BindGroup,
    shows: Option<SceneUniform>,
}

/// Columns of the texture of face colours.
const COLUMNS: u32 = 2048;
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

pub fn install(render_state: &RenderState) {
    let device = &render_state.device;
    let shader = device.create_shader_module(wgpu::include_wgsl!("mesh.wgsl"));
    let corners = wgpu::VertexBufferLayout {
        array_stride: 12,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3],
    };
    let depth = wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(true),
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    };
    let (names, corners) = (["vertex", "fragment"], [Some(corners)]);
    let mesh_pipeline = pipeline(device, &shader, names, &corners, Some(depth), COLOR);
    let names = ["screen_vertex", "screen_fragment"];
    let format = render_state.target_format;
    let screen_pipeline = pipeline(device, &shader, names, &[], None, format);
    let uniform = uniform_buffer::<SceneUniform>(device);
    let mut renderer = render_state.renderer.write();
    renderer.callback_resources.insert(Meshes {
        mesh_pipeline,
        screen_pipeline,
        uniform,
        corners: None,
        colors: None,
        target: None,
    });
}

impl CallbackTrait for MeshPaint {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        if let Some(meshes) = resources.get_mut::<Meshes>() {
            meshes.upload(device, queue, self);
            meshes.draw(device, queue, encoder, self);
        }
        Vec::new()
    }

    fn paint(
        &self,
        _info: PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        if let Some(meshes) = resources.get::<Meshes>()
            && let Some(target) = &meshes.target
        {
            pass.set_pipeline(&meshes.screen_pipeline);
            pass.set_bind_group(0, &target.bind_group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

impl Meshes {
    /// Brings faces and colours up to date.
    fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, paint: &MeshPaint) {
        let mut changed = false;
        if !matches!(&self.corners, Some((surface, _)) if Arc::ptr_eq(surface, &paint.surface)) {
            let corners = paint.surface.corners.iter();
            let points: Vec<[f32; 3]> = corners.flat_map(|c| c.map(|p| p.to_array())).collect();
            let buffer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("faces"),
                contents: bytemuck::cast_slice(&points),
                usage: wgpu::BufferUsages::VERTEX,
            });
            self.corners = Some((paint.surface.clone(), buffer));
            changed = true;
        }
        if !matches!(&self.colors, Some((colors, _)) if Arc::ptr_eq(colors, &paint.colors)) {
            let group = self.color_group(device, queue, &paint.colors);
            self.colors = Some((paint.colors.clone(), group));
            changed = true;
        }
        if let Some(target) = self.target.as_mut().filter(|_| changed) {
            target.shows = None;
        }
    }

    fn color_group(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        colors: &[[f32; 4]],
    ) -> wgpu::BindGroup {
        let rows = (colors.len() as u32).div_ceil(COLUMNS).max(1);
        let mut texels = colors.to_vec();
        texels.resize((rows * COLUMNS) as usize, [0.0; 4]);
        let texture = float_texture(device, "face colours", [COLUMNS, rows]);
        fill(queue, &texture, &texels);
        bind(
            device,
            &self.mesh_pipeline,
            Some(&self.uniform),
            &view(&texture),
        )
    }

    /// Draws the faces, unless the picture already shows them so.
    fn draw(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        paint: &MeshPaint,
    ) {
        if !matches!(&self.target, Some(target) if target.size == paint.size) {
            self.target = Some(self.new_target(device, paint.size));
        }
        let (Some(target), Some((surface, corners)), Some((_, colors))) =
            (&mut self.target, &self.corners, &self.colors)
        else {
            return;
        };
        if target.shows == Some(paint.uniform) {
            return;
        }
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&paint.uniform));
        let [r, g, b, a] = paint.uniform.background.map(f64::from);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("3D view"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.color,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                    store: wgpu::StoreOp::Store,
                },
                depth_slice: None,
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.mesh_pipeline);
        pass.set_bind_group(0, colors, &[]);
        pass.set_vertex_buffer(0, corners.slice(..));
        pass.draw(0..3 * surface.corners.len() as u32, 0..1);
        target.shows = Some(paint.uniform);
    }

    fn new_target(&self, device: &wgpu::Device, size: [u32; 2]) -> Target {
        let picture = |format, usage| view(&texture(device, "3D view", size, format, usage));
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let color = picture(COLOR, attachment | wgpu::TextureUsages::TEXTURE_BINDING);
        Target {
            size,
            bind_group: bind(device, &self.screen_pipeline, None, &color),
            depth: picture(DEPTH, attachment),
            color,
            shows: None,
        }
    }
}
