//! Linear pictures on the graphics card: uploads on change, and the paint callback that draws them.

use crate::app::picture::look::{Look, ToneCurve};
use crate::app::picture::quantity::Shading;
use crate::app::picture::ramp;
use crate::app::theme::Tokens;
use crate::session::snapshot::Picture;
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use egui::{Color32, PaintCallbackInfo, Rect};
use std::collections::HashMap;
use std::sync::Arc;
use wgpu::util::DeviceExt;

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
    /// The picture.
    pub picture: Arc<Picture>,
    /// Object index of each pixel, for outlines.
    pub objects: Option<Arc<Vec<u32>>>,
    /// The pane, in points.
    pub pane: Rect,
    /// Where the picture lies, in points.
    pub placement: Rect,
    /// How numbers become colours.
    pub shading: Shading,
    /// Magnitude at the end of false colours.
    pub range: f32,
    /// Factor on radiance.
    pub exposure: f32,
    /// Tone curve of radiance.
    pub tone: ToneCurve,
    /// Whether enlarged pixels are blended into each other, as long as they are small.
    pub smooth: bool,
    /// Object to outline.
    pub selected: Option<u32>,
    /// Colours.
    pub tokens: &'static Tokens,
}

impl PicturePaint {
    /// The picture as `look` shows it in `pane`.
    pub fn new(
        slot: egui::Id,
        picture: Arc<Picture>,
        pane: Rect,
        look: &Look,
        tokens: &'static Tokens,
    ) -> Self {
        let placement = look.placement(pane, [picture.width, picture.height]);
        Self {
            slot,
            picture,
            objects: None,
            pane,
            placement,
            shading: Shading::Radiance,
            range: 1.0,
            exposure: look.exposure.exp2(),
            tone: look.tone,
            smooth: false,
            selected: None,
            tokens,
        }
    }

    fn uniform(&self, pixels_per_point: f32) -> ViewUniform {
        let size = egui::vec2(self.picture.width as f32, self.picture.height as f32);
        let step = size / self.placement.size();
        let origin = (self.pane.min - self.placement.min) * step;
        let corner = self.pane.min.to_vec2() * pixels_per_point;
        ViewUniform {
            origin: origin.into(),
            step: (step / pixels_per_point).into(),
            corner: [corner.x.round(), corner.y.round()],
            exposure: self.exposure,
            tone: self.tone as u32,
            shading: self.shading as u32,
            range: self.range,
            selected: self.selected.map_or(-1.0, |object| object as f32),
            smooth: f32::from(u8::from(
                self.smooth && step.x > SMOOTH_STEP && step.x < 1.0,
            )),
            surround: rgba(self.tokens.surround),
            outline: rgba(self.tokens.accent),
            ramp: ramp::stops(self.shading).map(|[r, g, b]| [r, g, b, 1.0]),
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
    picture: Arc<Picture>,
    objects: Option<Arc<Vec<u32>>>,
    texture: wgpu::Texture,
    uniform: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

/// Prepares drawing pictures into a target of this format.
pub fn install(render_state: &eframe::egui_wgpu::RenderState) {
    let device = &render_state.device;
    let shader = device.create_shader_module(wgpu::include_wgsl!("picture.wgsl"));
    let pipeline = over_screen(render_state, &shader, ["vertex", "fragment"]);
    render_state
        .renderer
        .write()
        .callback_resources
        .insert(Pictures {
            pipeline,
            slots: HashMap::new(),
        });
}

/// A pipeline whose one triangle covers what is drawn into, with the entry points of a shader.
pub fn over_screen(
    render_state: &eframe::egui_wgpu::RenderState,
    shader: &wgpu::ShaderModule,
    [vertex, fragment]: [&str; 2],
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions::default;
    let descriptor = wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: None,
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(vertex),
            compilation_options: compilation_options(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: shader,
            entry_point: Some(fragment),
            compilation_options: compilation_options(),
            targets: &[Some(render_state.target_format.into())],
        }),
        multiview_mask: None,
        cache: None,
    };
    render_state.device.create_render_pipeline(&descriptor)
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
        let size = |picture: &Picture| [picture.width, picture.height];
        let known = pictures.slots.remove(&self.slot);
        let slot = match known.filter(|slot| size(&slot.picture) == size(&self.picture)) {
            None => Slot::new(device, queue, &pictures.pipeline, self),
            Some(mut slot) => {
                if !slot.shows(self) {
                    slot.picture = self.picture.clone();
                    slot.objects = self.objects.clone();
                    upload(queue, &slot.texture, &self.picture, self.objects.as_deref());
                }
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
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: extent(&paint.picture),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        upload(queue, &texture, &paint.picture, paint.objects.as_deref());
        let uniform = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("picture view"),
            contents: bytemuck::bytes_of(&paint.uniform(1.0)),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("picture"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: uniform.as_entire_binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
            ],
        });
        Self {
            picture: paint.picture.clone(),
            objects: paint.objects.clone(),
            texture,
            uniform,
            bind_group,
        }
    }

    fn shows(&self, paint: &PicturePaint) -> bool {
        let place = |objects: &Option<Arc<Vec<u32>>>| objects.as_ref().map(Arc::as_ptr);
        place(&self.objects) == place(&paint.objects) && Arc::ptr_eq(&self.picture, &paint.picture)
    }
}

fn extent(picture: &Picture) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width: picture.width.max(1),
        height: picture.height.max(1),
        depth_or_array_layers: 1,
    }
}

/// Writes a picture, with the object index of each pixel in alpha (−1 where none is known).
fn upload(
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    picture: &Picture,
    objects: Option<&Vec<u32>>,
) {
    let objects = objects.filter(|objects| objects.len() == picture.pixels.len());
    let texels: Vec<[f32; 4]> = picture
        .pixels
        .iter()
        .enumerate()
        .map(|(index, p)| {
            let object = objects.map_or(-1.0, |objects| match objects[index] {
                u32::MAX => -1.0,
                object => object as f32,
            });
            [p.x, p.y, p.z, object]
        })
        .collect();
    let size = extent(picture);
    if texels.len() != (size.width * size.height) as usize {
        return;
    }
    queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(&texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.width * 16),
            rows_per_image: None,
        },
        size,
    );
}
