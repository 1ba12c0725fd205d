//! Quantities: the words of the design as types and constants.

/// Three channels of light: linear red, green, blue. Units by context: W/m² or lm/m² for exitance, radiosity and
/// irradiance; W or lm for power.
pub type Rgb = [f32; 3];

/// The largest reflectance: higher ones are lowered to it, so that light dies out.
pub const MAX_REFLECTANCE: f32 = 0.95;

/// Photometric sum of three channels (Rec. 709 luminance weights): lux where the scene's units are photometric.
pub fn photometric(rgb: Rgb) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}
