//! The nearest known name to one that is not known.

/// Words that newcomers bring from other programs, with the language's own.
const SYNONYMS: &[(&str, &str)] = &[
    ("fov", "field_of_view"),
    ("resolution", "pixels"),
    ("size", "pixels"),
    ("target", "look_at"),
    ("eye", "position"),
    ("camera", "sensor"),
    ("location", "site"),
    ("lat", "latitude"),
    ("lon", "longitude"),
    ("vis", "visibility"),
    ("tilt", "slope"),
    ("yaw", "heading"),
    ("azimuth", "heading"),
    ("albedo", "reflectance"),
    ("polygon", "facet"),
    ("quad", "panel"),
    ("instance", "place"),
    ("time", "at"),
    ("spp", "samples"),
    ("rh", "humidity"),
    ("aot", "aod"),
    ("timezone", "zone"),
];

/// The known name that `wanted` most likely stands for: the same but for case or hyphens, a synonym, the only name that
/// it begins, or one within a third of the letters by the Damerau–Levenshtein distance.
pub fn nearest<'n>(wanted: &str, known: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    if wanted.is_empty() || wanted.len() > 64 {
        return None;
    }
    let plain = |name: &str| name.to_lowercase().replace(['-', '.'], "_");
    let wanted = plain(wanted);
    let synonym = SYNONYMS.iter().find(|(word, _)| *word == wanted).map(|(_, own)| *own);
    let mut prefixed = (None, 0);
    let mut best: Option<(usize, &str)> = None;
    let mut said = None;
    for name in known {
        let other = plain(name);
        if other == wanted {
            return Some(name);
        }
        if synonym == Some(name) {
            said = Some(name);
        }
        if wanted.len() >= 3 && other.starts_with(&wanted) {
            prefixed = (Some(name), prefixed.1 + 1);
        }
        let longer = other.len().max(wanted.len()).max(3);
        if other.len().abs_diff(wanted.len()) * 3 <= longer {
            let distance = strsim::damerau_levenshtein(&wanted, &other);
            if distance * 3 <= longer && best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, name));
            }
        }
    }
    let prefixed = if prefixed.1 == 1 { prefixed.0 } else { None };
    said.or(best.map(|(_, name)| name)).or(prefixed)
}

/// Names in a row for a message, cut where they are many.
pub fn list<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    const SHOWN: usize = 40;
    let names: Vec<&str> = names.into_iter().collect();
    let more = names.len().saturating_sub(SHOWN);
    let shown = names[..names.len() - more].join(", ");
    if more == 0 { shown } else { format!("{shown} and {more} more") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_the_pen_find_their_word() {
        let known = ["ifov", "field_of_view", "pixels", "position", "look_at", "visibility", "grey_05", "grey_10"];
        for (wanted, found) in [
            ("pixel", Some("pixels")),
            ("Pixels", Some("pixels")),
            ("look-at", Some("look_at")),
            ("lokat", Some("look_at")),
            ("fov", Some("field_of_view")),
            ("hight", None),
            ("vis", Some("visibility")),
            ("grey_5", Some("grey_05")),
            ("banana", None),
            ("", None),
        ] {
            assert_eq!(nearest(wanted, known), found, "{wanted}");
        }
    }
}
