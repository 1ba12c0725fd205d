//! Values of flags: text → checked value, or what is wrong with it.

use crate::outputs::{Kind, Output};
use std::path::PathBuf;
use std::str::FromStr;

/// Pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Exposure asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExposureChoice {
    /// From the light.
    Auto,
    /// Exposure value at ISO 100.
    Value(f32),
}

/// Where and how often to save.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointChoice {
    /// File.
    pub file: PathBuf,
    /// Seconds between writes; 0 writes after every shot.
    pub seconds: f64,
}

/// Number of rings asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingsChoice {
    /// As many as memory allows.
    Auto,
    /// So many.
    Number(usize),
}

/// A matrix asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matrix {
    /// Where.
    pub path: PathBuf,
    /// Whether as NumPy array instead of CSV.
    pub numpy: bool,
}

/// A finite number.
pub fn number(text: &str) -> Result<f64, String> {
    let number = f64::from_str(text.trim()).map_err(|_| format!("'{text}' is not a number"))?;
    if number.is_finite() { Ok(number) } else { Err(format!("'{text}' is not a finite number")) }
}

/// Where to serve: `host:port`, or a port of this machine alone.
pub fn address(text: &str) -> Result<String, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or(("127.0.0.1", text));
    match u16::from_str(port) {
        Ok(port) if !host.is_empty() => Ok(format!("{host}:{port}")),
        _ => Err(format!("'{text}' is no address; expected host:port")),
    }
}

/// Numbers separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let all: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    all.try_into().map_err(|all: Vec<f64>| format!("'{text}' has {} numbers; expected {N}", all.len()))
}

/// A finite number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = number(text)?;
    if number > 0.0 { Ok(number) } else { Err(format!("{text} is not above 0")) }
}

/// A share: from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    let number = number(text)?;
    if (0.0..=1.0).contains(&number) { Ok(number) } else { Err(format!("{text} is not between 0 and 1")) }
}

/// A relative tolerance: from 10⁻⁹ to 1.
pub fn tolerance(text: &str) -> Result<f64, String> {
    let number = number(text)?;
    if (1e-9..=1.0).contains(&number) { Ok(number) } else { Err(format!("{text} is not between 1e-9 and 1")) }
}

/// The least factor: above 0, at most 1.
pub fn least(text: &str) -> Result<f64, String> {
    let number = positive(text)?;
    if number <= 1.0 { Ok(number) } else { Err(format!("{text} is above 1, as no factor is")) }
}

/// A path whose ending says how to write a matrix.
pub fn matrix(text: &str) -> Result<Matrix, String> {
    let path = PathBuf::from(text);
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    match ending.as_deref() {
        Some("csv") => Ok(Matrix { path, numpy: false }),
        Some("npy") => Ok(Matrix { path, numpy: true }),
        _ => Err("its ending says no known kind of matrix; known are .csv and .npy".into()),
    }
}

/// Threads: 1 to 4096.
pub fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n @ 1..=4096) => Ok(n),
        _ => Err("expected a number from 1 to 4096".into()),
    }
}

/// Rings: a number from 1, or `auto`. How many ranks there are is known later.
pub fn rings(text: &str) -> Result<RingsChoice, String> {
    match text.parse() {
        Ok(rings @ 1..) => Ok(RingsChoice::Number(rings)),
        _ if text == "auto" => Ok(RingsChoice::Auto),
        _ => Err("expected a number from 1 to the number of ranks, or auto".into()),
    }
}

/// Points of a packet: 1 to 1048576.
pub fn packet_size(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n @ 1..=0x10_0000) => Ok(n),
        _ => Err("expected a number from 1 to 1048576".into()),
    }
}

/// Shooters in flight: 1 to 1024.
pub fn shooters(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(n @ 1..=1024) => Ok(n),
        _ => Err("expected a number from 1 to 1024".into()),
    }
}

/// Bytes: a number with a unit.
pub fn memory(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, u64); 9] = [
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
        ("TiB", 1 << 40),
        ("kB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("TB", 1_000_000_000_000),
        ("B", 1),
    ];
    let split = |(unit, bytes): &(&str, u64)| {
        let end = text.len().checked_sub(unit.len()).filter(|&end| text.is_char_boundary(end))?;
        text[end..].eq_ignore_ascii_case(unit).then_some((&text[..end], *bytes))
    };
    let expected = || format!("'{text}' is no amount of memory; expected a number and a unit, as in 2GiB or 500MB");
    let (amount, unit) = UNITS.iter().find_map(split).ok_or_else(expected)?;
    let bytes = positive(amount).map_err(|_| expected())? * unit as f64;
    if (1.0..1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(expected()) }
}

/// Cells of a shooter.
pub fn cells(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(n @ (1 | 4 | 16 | 64)) => Ok(n),
        _ => Err("expected 1, 4, 16 or 64".into()),
    }
}

/// One number or three, not negative, not all 0.
pub fn radiance(text: &str) -> Result<[f32; 3], String> {
    let rgb = if text.contains(',') { numbers(text)? } else { [number(text)?; 3] };
    let single = rgb.map(|x| x as f32);
    if single.iter().any(|&x| x < 0.0 || x.is_infinite()) || single == [0.0; 3] {
        return Err("expected radiance above 0, as one number or R,G,B".into());
    }
    Ok(single)
}

/// `NAME` or `ex,ey,ez;tx,ty,tz;fov` (metres in world space, degrees), as it was given.
pub fn camera(text: &str) -> Result<String, String> {
    if !text.contains(';') {
        return Ok(text.into());
    }
    let [eye, target, field_of_view] = *text.split(';').collect::<Vec<_>>() else {
        return Err("expected position;target;field of view, as in 3,1.6,4;0,1,0;60".into());
    };
    let (eye, target, field_of_view) = (numbers::<3>(eye)?, numbers::<3>(target)?, number(field_of_view)?);
    if eye == target {
        return Err("the camera stands where it looks".into());
    }
    if !(field_of_view > 0.0 && field_of_view < 180.0) {
        return Err("expected a field of view between 0 and 180 degrees".into());
    }
    Ok(text.into())
}

/// The largest edge of a picture, pixels.
const LARGEST_EDGE: u32 = 32_768;

/// `WIDTHxHEIGHT`.
pub fn size(text: &str) -> Result<PictureSize, String> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((width @ 1..=LARGEST_EDGE, height @ 1..=LARGEST_EDGE)) => Ok(PictureSize { width, height }),
        _ => Err(format!("expected WIDTHxHEIGHT with 1 to {LARGEST_EDGE} pixels each, as in 1280x720")),
    }
}

/// A number or `auto`.
pub fn exposure(text: &str) -> Result<ExposureChoice, String> {
    if text == "auto" {
        return Ok(ExposureChoice::Auto);
    }
    let value = number(text)?;
    if value.abs() <= 100.0 {
        Ok(ExposureChoice::Value(value as f32))
    } else {
        Err("expected an exposure value between -100 and 100, or auto".into())
    }
}

/// `FILE` or `FILE@SECONDS`.
pub fn checkpoint(text: &str) -> Result<CheckpointChoice, String> {
    let (file, seconds) = match text.rsplit_once('@') {
        Some((file, seconds)) if f64::from_str(seconds).is_ok() => (file, number(seconds)?),
        _ => (text, 60.0),
    };
    if file.is_empty() || seconds < 0.0 {
        return Err("expected FILE or FILE@SECONDS, as in part.ringlight@60".into());
    }
    Ok(CheckpointChoice { file: file.into(), seconds })
}

/// A path whose ending says what to write.
pub fn output(text: &str) -> Result<Output, String> {
    let path = PathBuf::from(text);
    match Kind::of(&path) {
        Some(kind) => Ok(Output { path, kind }),
        None => Err(format!("its ending says no known kind of output; known are {}", Kind::ENDINGS)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_shares_refuse_what_makes_no_sense() {
        assert_eq!(positive("0.25"), Ok(0.25));
        for bad in ["0", "-1", "nan", "inf", "1e999", "two", ""] {
            assert!(positive(bad).is_err(), "{bad}");
        }
        assert!(share("1.01").is_err() && share("0").is_ok());
        assert!(cells("32").is_err() && cells("64").is_ok());
        assert!(size("0x10").is_err() && size("10").is_err() && size("99999x1").is_err());
    }

    #[test]
    fn memory_has_a_unit() {
        assert_eq!(memory("2GiB"), Ok(2 << 30));
        assert_eq!(memory("1.5 MiB"), Ok(3 << 19));
        assert_eq!((memory("500MB"), memory("64kb"), memory("7B")), (Ok(500_000_000), Ok(64_000), Ok(7)));
        for bad in ["2", "", "GiB", "0MB", "-1GB", "1e30GB", "nanMB", "2 GiBs", "é", "0.5B"] {
            assert!(memory(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn rings_are_counted_from_one() {
        assert_eq!((rings("auto"), rings("3")), (Ok(RingsChoice::Auto), Ok(RingsChoice::Number(3))));
        assert!(rings("0").is_err() && rings("-1").is_err() && rings("Auto").is_err());
        assert!(packet_size("0").is_err() && packet_size("1").is_ok());
    }

    #[test]
    fn matrices_are_known_by_their_ending() {
        assert!(!matrix("a.b/F.CSV").unwrap().numpy && matrix("F.npy").unwrap().numpy);
        assert!(matrix("F").is_err() && matrix("F.glb").is_err() && matrix("csv").is_err());
        assert!(least("1e-5").is_ok() && least("0").is_err() && least("2").is_err());
        assert!(tolerance("0").is_err() && tolerance("nan").is_err() && tolerance("0.01").is_ok());
    }

    #[test]
    fn a_sky_is_grey_or_coloured() {
        assert_eq!(radiance("2"), Ok([2.0; 3]));
        assert_eq!(radiance("1,2,3"), Ok([1.0, 2.0, 3.0]));
        for bad in ["1,2", "-1", "0", "1e300", "1,-1,0"] {
            assert!(radiance(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_camera_is_a_name_or_a_position_a_target_and_an_angle() {
        assert!(camera("desk").is_ok() && camera("-3,1.6,4;0,1,0;60").is_ok());
        for bad in ["1,2,3;1,2,3;60", "1,2,3;0,0,0", "1,2;0,0,0;60", "1,2,3;0,0,0;180"] {
            assert!(camera(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_checkpoint_may_say_its_interval() {
        let choice = |file: &str, seconds| Ok(CheckpointChoice { file: file.into(), seconds });
        assert_eq!(checkpoint("a.ringlight"), choice("a.ringlight", 60.0));
        assert_eq!(checkpoint("a.ringlight@5"), choice("a.ringlight", 5.0));
        assert_eq!(checkpoint("me@home/a.ringlight"), choice("me@home/a.ringlight", 60.0));
        assert!(checkpoint("a@-1").is_err() && checkpoint("@5").is_err() && checkpoint("a@inf").is_err());
    }
}
