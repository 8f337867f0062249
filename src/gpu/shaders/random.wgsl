// Keyed random streams, bit for bit those of `math::rng`: PCG-XSH-RR 32, seeded by SplitMix64.
// 64-bit numbers are pairs of words, the low one first.

var<private> stream_state: vec2<u32>;
var<private> stream_increment: vec2<u32>;

fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let first = a1 * b0 + (low >> 16u);
    let second = a0 * b1 + (first & 0xffffu);
    return vec2<u32>((second << 16u) | (low & 0xffffu), a1 * b1 + (first >> 16u) + (second >> 16u));
}

fn multiply(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let product = wide_product(a.x, b.x);
    return vec2<u32>(product.x, product.y + a.x * b.y + a.y * b.x);
}

fn add(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn subtract(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(a.x - b.x, a.y - b.y - select(0u, 1u, a.x < b.x));
}

fn less(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

// `bits` from 1 to 31.
fn shift_right(a: vec2<u32>, bits: u32) -> vec2<u32> {
    return vec2<u32>((a.x >> bits) | (a.y << (32u - bits)), a.y >> bits);
}

fn as_float(a: vec2<u32>) -> f32 {
    return f32(a.y) * 4294967296.0 + f32(a.x);
}

fn splitmix(key: vec2<u32>) -> vec2<u32> {
    var x = add(key, vec2<u32>(0x7f4a7c15u, 0x9e3779b9u));
    x = multiply(x ^ shift_right(x, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
    x = multiply(x ^ shift_right(x, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
    return x ^ shift_right(x, 31u);
}

// Begins the stream of a pixel's sample; `dispatch.key` holds the hash of seed and frame.
fn begin_stream(pixel: u32, sample: u32) {
    let hash = splitmix(splitmix(dispatch.key.xy ^ vec2<u32>(pixel, 0u)) ^ vec2<u32>(sample, 0u));
    stream_state = splitmix(hash);
    stream_increment = splitmix(hash ^ vec2<u32>(0x4c957f2du, 0x5851f42du)) | vec2<u32>(1u, 0u);
    next_word();
}

fn next_word() -> u32 {
    let old = stream_state;
    stream_state = add(multiply(old, vec2<u32>(0x4c957f2du, 0x5851f42du)), stream_increment);
    let mixed = shift_right(shift_right(old, 18u) ^ old, 27u).x;
    let turn = old.y >> 27u;
    return (mixed >> turn) | (mixed << ((32u - turn) & 31u));
}

// In [0, 1), a multiple of 2⁻²⁴.
fn uniform1() -> f32 {
    return f32(next_word() >> 8u) * (1.0 / 16777216.0);
}

fn uniform2() -> vec2<f32> {
    let first = uniform1();
    return vec2<f32>(first, uniform1());
}

// 53 random bits.
fn uniform53() -> vec2<u32> {
    let high = next_word();
    let low = next_word();
    return shift_right(vec2<u32>(low, high), 11u);
}
