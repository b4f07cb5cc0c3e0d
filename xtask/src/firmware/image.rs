//! What must and must not be in an image.

use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

use crate::shell::Step;

/// Most bytes of flash that the drive's image may take: what was measured, and a twentieth more.
const MOST_FLASH: u64 = 121_000;
/// Most bytes of RAM beside tables, images and the stack.
const MOST_RAM: u64 = 5_330;
/// The two table buffers of the drive's image, and the two images of the board's model of flash.
const BUFFERS: u64 = 2 * 64 * 1024 + 2 * 256 * 1024;

/// Names of what runs when something panics; the handler that the board must have is none of them.
const PANICS: [&str; 3] = ["core9panicking", "panic_fmt", "panic_bounds_check"];

/// Holds the drive's image to its gates: no panic, no fused multiply-add, size.
pub(crate) fn check(path: &Path) -> Step {
    with(path, |image| {
        no_panic(image)?;
        no_fusing(image)?;
        let size = |kinds: &[SectionKind]| -> u64 {
            image.sections().filter(|s| kinds.contains(&s.kind())).map(|s| s.size()).sum()
        };
        let data = size(&[SectionKind::Data]);
        let flash = size(&[SectionKind::Text, SectionKind::ReadOnlyData]) + data;
        let ram = (size(&[SectionKind::UninitializedData]) + data).saturating_sub(BUFFERS);
        eprintln!(
            "  drive image: {flash} bytes of flash, {ram} of static RAM beside {BUFFERS} for tables and images"
        );
        for (what, found, most) in [("flash", flash, MOST_FLASH), ("RAM", ram, MOST_RAM)] {
            if found > most {
                return Err(format!("{found} bytes of {what}, at most {most} are allowed"));
            }
        }
        Ok(())
    })
}

/// Holds any image to the rule that keeps its bits those of the host.
pub(crate) fn check_instructions(path: &Path) -> Step {
    with(path, no_fusing)
}

fn with(path: &Path, judge: impl FnOnce(&object::File) -> Step) -> Step {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let image = object::File::parse(bytes.as_slice()).map_err(|e| format!("{}: {e}", path.display()))?;
    judge(&image).map_err(|e| format!("{}: {e}", path.display()))
}

/// No function of the panic machinery is linked.
fn no_panic(image: &object::File) -> Step {
    for symbol in image.symbols() {
        let name = symbol.name().unwrap_or_default();
        if PANICS.iter().any(|part| name.contains(part)) {
            return Err(format!("a panic is possible: {name} is linked"));
        }
    }
    Ok(())
}

/// No multiplication is fused with an addition: that rounds once where the host rounds twice.
fn no_fusing(image: &object::File) -> Step {
    let mut looked_at = 0;
    for section in image.sections().filter(|s| s.kind() == SectionKind::Text) {
        let code = section.data().map_err(|e| e.to_string())?;
        for (from, to) in stretches(image, &section) {
            let bytes = code.get(from..to).unwrap_or(&[]);
            looked_at += bytes.len();
            if let Some(at) = fused(bytes) {
                let address = section.address() + (from + at) as u64;
                return Err(format!("a fused multiply-add at {address:#x}"));
            }
        }
    }
    if looked_at == 0 { Err("there is no code to look at".into()) } else { Ok(()) }
}

/// Where there is code and no data, as offsets: what mapping symbols say (ELF for the Arm architecture, 5.5.5).
fn stretches(image: &object::File, section: &object::Section) -> Vec<(usize, usize)> {
    let mut marks: Vec<(u64, bool)> = image
        .symbols()
        .filter(|s| s.section_index() == Some(section.index()) && s.kind() != SymbolKind::Section)
        .filter_map(|s| match s.name().unwrap_or_default().split('.').next()? {
            "$t" => Some((s.address(), true)),
            "$d" => Some((s.address(), false)),
            _ => None,
        })
        .collect();
    marks.sort_unstable();
    let (begin, end) = (section.address(), section.address() + section.size());
    let ends = marks.iter().skip(1).map(|m| m.0).chain([end]);
    marks
        .iter()
        .zip(ends)
        .filter(|((_, code), _)| *code)
        .map(|((from, _), to)| ((from - begin) as usize, (to - begin) as usize))
        .collect()
}

/// Offset of the first VFMA, VFMS, VFNMA or VFNMS in Thumb code (Armv7-M reference manual, A7.7.228 and 229).
fn fused(code: &[u8]) -> Option<usize> {
    let half = |at: usize| code.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let mut at = 0;
    while let Some(first) = half(at) {
        let long = first >> 11 >= 0b11101;
        if long && let Some(second) = half(at + 2) {
            let multiplies = matches!(first & 0xffb0, 0xeea0 | 0xee90);
            if multiplies && second & 0x0e10 == 0x0a00 {
                return Some(at);
            }
        }
        at += if long { 4 } else { 2 };
    }
    None
}

#[cfg(test)]
mod checks {
    use super::*;

    #[test]
    fn fused_instructions_are_told_from_others() {
        let code = |halves: &[u16]| halves.iter().flat_map(|h| h.to_le_bytes()).collect::<Vec<u8>>();
        // vmul.f32 s0, s0, s1; vmla.f32 s0, s1, s2; bx lr
        assert_eq!(fused(&code(&[0xee20, 0x0a20, 0xee00, 0x0a81, 0x4770])), None);
        // nop; vfma.f32 s0, s1, s2
        assert_eq!(fused(&code(&[0xbf00, 0xeea0, 0x0a81])), Some(2));
        // vfms.f32 s0, s1, s2; vfnma.f32 s0, s1, s2
        assert_eq!(fused(&code(&[0xeea0, 0x0ac1])), Some(0));
        assert_eq!(fused(&code(&[0xee90, 0x0a81])), Some(0));
        // The second half of bl looks like one, and is none.
        assert_eq!(fused(&code(&[0xf000, 0xf8a0, 0x4770])), None);
    }
}
