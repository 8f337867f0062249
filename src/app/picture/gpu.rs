//! Linear pictures on the graphics card: uploads on change, and the paint callback that draws them.

use crate::app::picture::drawn::Drawn;
use crate::app::picture::look::Look;
use crate::app::picture::quantity::Shading;
use crate::app::picture::ramp;
use crate::app::theme::Tokens;
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use egui::{Color32, PaintCallbackInfo, Rect};
use std::collections::HashMap;
use std::sync::Arc;

/// Pixels of a picture that a point of the screen shows at least, where they are blended; larger ones are shown as they are.
const SMOOTH_STEP: f32 = 1.0 / 12.0;

/// The uniform block of `picture.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct ViewUniform {
    origin: [f32; 2],
    step: [f32; 2],
    corner: [f32; 2],
    exposure: f32,
    tone: u32,
    shading: u32,
    range: f32,
    selected: f32,
    smooth: f32,
    surround: [f32; 4],
    outline: [f32; 4],
    ramp: [[f32; 4]; ramp::STOPS],
}

/// Draws one picture; made anew each pass, so it carries the newest picture and compares when preparing.
pub struct PicturePaint {
    /// Which texture to keep it in: one for each pane and side.
    pub slot: egui::Id,
    pub drawn: Drawn,
    pub look: Look,
    /// The pane, in points.
    pub pane: Rect,
    /// Object to outline.
    pub selected: Option<u32>,
    pub tokens: &'static Tokens,
}

impl PicturePaint {
    fn uniform(&self, pixels_per_point: f32) -> ViewUniform {
        let shading = self.drawn.quantity.shading();
        let size = self.drawn.size();
        let placement = self.look.placement(self.pane, size);
        let step = egui::Vec2::from(size.map(|side| side as f32)) / placement.size();
        let origin = (self.pane.min - placement.min) * step;
        let corner = self.pane.min.to_vec2() * pixels_per_point;
        let enlarged = step.x > SMOOTH_STEP && step.x < 1.0;
        ViewUniform {
            origin: origin.into(),
            step: (step / pixels_per_point).into(),
            corner: [corner.x.round(), corner.y.round()],
            exposure: self.look.exposure.exp2(),
            tone: self.look.tone as u32,
            shading: shading as u32,
            range: self.drawn.range,
            selected: self.selected.map_or(-1.0, |object| object as f32),
            smooth: f32::from(u8::from(enlarged && shading == Shading::Radiance)),
            surround: rgba(self.tokens.surround),
            outline: rgba(self.tokens.accent),
            ramp: ramp::stops(shading).map(|[r, g, b]| [r, g, b, 1.0]),
        }
    }
}

/// A theme colour as it goes to egui's target, which is not sRGB-aware.
pub fn rgba(color: Color32) -> [f32; 4] {
    color.to_normalized_gamma_f32()
}

/// What all pictures share on the card.
struct Pictures {
    pipeline: wgpu::RenderPipeline,
    slots: HashMap<egui::Id, Slot>,
}

/// One picture on the card, and what it was made from.
struct Slot {
    drawn: Drawn,
    texture: wgpu::Texture,
    uniform: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

pub fn install(render_state: &eframe::egui_wgpu::RenderState) {
    let device = &render_state.device;
    let shader = device.create_shader_module(wgpu::include_wgsl!("picture.wgsl"));
    let (names, format) = (["vertex", "fragment"], render_state.target_format);
    let pictures = Pictures {
        pipeline: pipeline(device, &shader, names, &[], None, format),
        slots: HashMap::new(),
    };
    let mut renderer = render_state.renderer.write();
    renderer.callback_resources.insert(pictures);
}

/// A pipeline with the entry points of a shader, which draws into a target of a format. Without buffers of vertices, one
/// triangle covers the target.
pub fn pipeline(
    device: &wgpu::Device,
    shader: &wgpu::ShaderModule,
    [vertex, fragment]: [&str; 2],
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    depth_stencil: Option<wgpu::DepthStencilState>,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions::default;
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: None,
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(vertex),
            compilation_options: compilation_options(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: shader,
            entry_point: Some(fragment),
            compilation_options: compilation_options(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// A texture of one level, with at least one pixel.
pub fn texture(
    device: &wgpu::Device,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width: width.max(1),
            height: height.max(1),
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A texture of four numbers a pixel that can be filled.
pub fn float_texture(device: &wgpu::Device, label: &str, size: [u32; 2]) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let format = wgpu::TextureFormat::Rgba32Float;
    texture(device, label, size, format, usage)
}

/// Writes all pixels of such a texture.
pub fn fill(queue: &wgpu::Queue, texture: &wgpu::Texture, texels: &[[f32; 4]]) {
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(texture.width() * 16),
        rows_per_image: None,
    };
    let (bytes, size) = (bytemuck::cast_slice(texels), texture.size());
    queue.write_texture(texture.as_image_copy(), bytes, layout, size);
}

impl CallbackTrait for PicturePaint {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        screen: &ScreenDescriptor,
        _encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let Some(pictures) = resources.get_mut::<Pictures>() else {
            return Vec::new();
        };
        let known = pictures.slots.remove(&self.slot);
        let slot = match known.filter(|slot| slot.drawn.size() == self.drawn.size()) {
            None => Slot::new(device, queue, &pictures.pipeline, self),
            Some(slot) if slot.shows(self) => slot,
            Some(mut slot) => {
                slot.drawn = self.drawn.clone();
                upload(queue, &slot.texture, &self.drawn);
                slot
            }
        };
        let uniform = self.uniform(screen.pixels_per_point);
        queue.write_buffer(&slot.uniform, 0, bytemuck::bytes_of(&uniform));
        pictures.slots.insert(self.slot, slot);
        Vec::new()
    }

    fn paint(
        &self,
        _info: PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        let Some(pictures) = resources.get::<Pictures>() else {
            return;
        };
        if let Some(slot) = pictures.slots.get(&self.slot) {
            pass.set_pipeline(&pictures.pipeline);
            pass.set_bind_group(0, &slot.bind_group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

impl Slot {
    fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipeline: &wgpu::RenderPipeline,
        paint: &PicturePaint,
    ) -> Self {
        let texture = float_texture(device, "picture", paint.drawn.size());
        upload(queue, &texture, &paint.drawn);
        let uniform = uniform_buffer::<ViewUniform>(device);
        let bind_group = bind(device, pipeline, Some(&uniform), &view(&texture));
        Self {
            drawn: paint.drawn.clone(),
            texture,
            uniform,
            bind_group,
        }
    }

    fn shows(&self, paint: &PicturePaint) -> bool {
        let place = |drawn: &Drawn| drawn.objects.as_ref().map(Arc::as_ptr);
        let same = Arc::ptr_eq(&self.drawn.picture, &paint.drawn.picture);
        same && place(&self.drawn) == place(&paint.drawn)
    }
}

pub fn uniform_buffer<T>(device: &wgpu::Device) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(std::any::type_name::<T>()),
        size: size_of::<T>() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

pub fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Binds to a pipeline what it reads: a texture, and a uniform block before it where there is one.
pub fn bind(
    device: &wgpu::Device,
    pipeline: &wgpu::RenderPipeline,
    uniform: Option<&wgpu::Buffer>,
    texture: &wgpu::TextureView,
) -> wgpu::BindGroup {
    let resources = (uniform.map(wgpu::Buffer::as_entire_binding).into_iter())
        .chain([wgpu::BindingResource::TextureView(texture)]);
    let entries = (0..).zip(resources);
    let entries: Vec<_> = entries
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

/// Writes a picture, with the object index of each pixel in alpha (−1 where none is known).
fn upload(queue: &wgpu::Queue, texture: &wgpu::Texture, drawn: &Drawn) {
    let picture = &drawn.picture;
    let objects = drawn.objects.as_ref();
    let objects = objects.filter(|objects| objects.len() == picture.pixels.len());
    let object = |index: usize| match objects.map(|objects| objects[index]) {
        None | Some(u32::MAX) => -1.0,
        Some(object) => object as f32,
    };
    let texels: Vec<[f32; 4]> = (picture.pixels.iter().enumerate())
        .map(|(index, p)| p.extend(object(index)).to_array())
        .collect();
    if texels.len() == (texture.width() * texture.height()) as usize {
        fill(queue, texture, &texels);
    }
}
