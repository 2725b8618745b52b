//! Sensors: pose, optics, bands.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use sunglint_plugin::Role;
use sunglint_radiometry::Dimension;

use super::block::{Body, Braces, Line, Owner, Rule, rule};
use super::names::Kind;
use super::value::{BANDWIDTH, COORDINATE, Quantity, SIZE, TURN, WAVELENGTH};
use super::{Checker, Entity};
use crate::ast::{Item, Value};
use crate::scene::{Bands, Flight, ModelUse, Optics, Projection, Sensor, SensorPose, Site};
use crate::{Diagnostic, Span};

const FROM_TARGET: &[&str] = &["altitude", "view_zenith", "view_azimuth"];
const NOT_FROM_TARGET: &[&str] = &["position", "depression", "roll"];
/// A frame camera has one of these or a heading; to a scanner the heading says where it flies.
const LOOKING: [&str; 4] = ["look_at", "altitude", "view_zenith", "view_azimuth"];

/// The statements of a sensor's block.
pub(super) const SENSOR: &[Rule] = &[
    rule("projection", "projection perspective|orthographic|pushbroom|whiskbroom"),
    rule("position", "position POINT").excludes(FROM_TARGET),
    rule("look_at", "look_at POINT").excludes(&["depression"]),
    rule("heading", "heading ANGLE"),
    rule("depression", "depression ANGLE").excludes(&["look_at", "altitude", "view_zenith", "view_azimuth"]),
    rule("roll", "roll ANGLE").excludes(FROM_TARGET),
    rule("altitude", "altitude LENGTH").excludes(NOT_FROM_TARGET),
    rule("view_zenith", "view_zenith ANGLE").excludes(NOT_FROM_TARGET),
    rule("view_azimuth", "view_azimuth ANGLE").excludes(NOT_FROM_TARGET),
    rule("field_of_view", "field_of_view ANGLE").excludes(&["ifov", "focal_length", "swath", "ground_sample"]),
    rule("ifov", "ifov ANGLE").excludes(&["focal_length", "swath", "ground_sample"]),
    rule("focal_length", "focal_length LENGTH").excludes(&["swath", "ground_sample"]),
    rule("swath", "swath LENGTH").excludes(&["ground_sample"]),
    rule("ground_sample", "ground_sample LENGTH"),
    rule("pixels", "pixels 640 x 480").required(),
    rule("speed", "speed 70 m/s"),
    rule("line_rate", "line_rate 100 Hz"),
    rule("band", "band NAME 600..700 nm").many().leading(1).clauses(&[
        rule("centre", "centre WAVELENGTH fwhm WAVELENGTH"),
        rule("fwhm", "centre WAVELENGTH fwhm WAVELENGTH"),
        rule("response", "response FILE"),
    ]),
    rule("bands", "bands SET only NAMES").many().clauses(&[
        rule("only", "only NAMES").word(),
        rule("every", "every WAVELENGTH"),
        rule("fwhm", "fwhm WAVELENGTH"),
    ]),
    rule("ccd", "ccd { … }").braces(Braces::Required),
    rule("collect", "collect NAMES"),
];

/// Whether a `band` of a child says again one of its parent: by its name; `bands` as a whole.
pub(super) fn same_band(old: &Line, new: &Line) -> bool {
    let name = |line: &Line| match line.items {
        [Item { value: Value::Word(name), .. }, ..] => name.clone(),
        _ => String::new(),
    };
    old.key == new.key && (old.key == "bands" || name(old) == name(new))
}

/// The most pixels across or down.
const MOST_PIXELS: u64 = 65_535;
/// The most bands of one series.
const MOST_BANDS: f64 = 10_000.0;

impl<'a> Checker<'a> {
    pub(super) fn sensor(
        &mut self,
        entity: &Entity<'a>,
        body: &Body<'a>,
        collects: usize,
        site: Option<Site>,
    ) -> Sensor {
        let owner = Owner { exclusion: "V01", ..Owner::new("a sensor", &entity.line) };
        let projection = match body.get("projection") {
            Some(line) => self.projection(&line),
            None => Some(Projection::Perspective),
        };
        let scans = projection.is_some_and(Projection::is_scanner);
        let flight = if scans { self.flight(body, &owner) } else { None };
        let framed;
        let body = match projection {
            Some(_) if !scans => {
                framed = self.framed(body);
                &framed
            }
            _ => body,
        };
        let pose = self.sensor_pose(body, site, scans, &owner);
        let ccd = self.detector(body);
        let optics = projection.and_then(|projection| self.optics(body, projection, ccd.as_ref(), &owner));
        let pixels = body.get("pixels").and_then(|line| self.grid(&line, MOST_PIXELS));
        if let (Some(flight), Some(ccd), Some((across, _))) = (flight, &ccd, pixels) {
            let pixels_in_turn = if projection == Some(Projection::Whiskbroom) { across as f64 } else { 1.0 };
            self.exposure_fits(body, ccd, flight.line_rate * pixels_in_turn);
        }
        let bands = self.bands(body, &owner);
        let collects = match body.get("collect") {
            Some(line) => self.references(&line, line.items, Kind::Collect).unwrap_or_default(),
            None => (0..collects).collect(),
        };
        let (across, down) = pixels.unwrap_or((1, 1));
        Sensor {
            name: entity.shown().to_string(),
            projection: projection.unwrap_or(Projection::Perspective),
            pose: pose.unwrap_or(SensorPose::Attitude {
                position: DVec3::ZERO,
                heading: 0.0,
                depression: FRAC_PI_2,
                roll: 0.0,
            }),
            optics: optics.unwrap_or(Optics::FieldOfView(1.0)),
            pixels: (across as u32, down as u32),
            flight,
            ccd,
            bands,
            collects,
            span: entity.line.span(),
        }
    }

    fn projection(&mut self, line: &Line<'a>) -> Option<Projection> {
        match self.word_of(line, &["perspective", "orthographic", "pushbroom", "whiskbroom"])? {
            "perspective" => Some(Projection::Perspective),
            "orthographic" => Some(Projection::Orthographic),
            "pushbroom" => Some(Projection::Pushbroom),
            _ => Some(Projection::Whiskbroom),
        }
    }

    /// How a scanner moves.
    fn flight(&mut self, body: &Body<'a>, owner: &Owner) -> Option<Flight> {
        let lacking: Vec<&str> = ["speed", "line_rate"].into_iter().filter(|key| !body.said(key)).collect();
        if !lacking.is_empty() {
            let lacks: Vec<String> = lacking.iter().map(|key| format!("`{key}`")).collect();
            let message = format!("this scanner lacks {}: N lines come one by one", lacks.join(" and "));
            let form: Vec<&str> =
                SENSOR.iter().filter(|rule| lacking.contains(&rule.key)).map(|rule| rule.form).collect();
            self.missing("V01", &message, &form.join(", "), owner);
        }
        let speed = Quantity::new(Dimension::Speed).positive(1e6).usual("m/s");
        let rate = Quantity::new(Dimension::Rate).positive(1e9).usual("Hz");
        let speed = self.optional(body.get("speed"), &speed);
        let line_rate = self.optional(body.get("line_rate"), &rate);
        let heading = body.get("heading").map_or(Some(0.0), |line| self.quantity(&line, &TURN));
        Some(Flight { heading: heading?, speed: speed?, line_rate: line_rate? })
    }

    /// The block of a frame camera without what belongs to a scanner, and with either a heading or what it looks at: what
    /// the sensor says itself goes before what it has by `like`.
    fn framed(&mut self, body: &Body<'a>) -> Body<'a> {
        let mut body = body.clone();
        for key in ["speed", "line_rate"] {
            if let Some(line) = body.get(key) {
                let message = format!("`{key}` belongs to a scanner; this sensor is a frame camera");
                let fault = Diagnostic::error("V01", line.span(), message).label("leave it out");
                self.report(fault.help("scanners are `projection pushbroom` and `projection whiskbroom`"));
            }
        }
        let Some(heading) = body.get("heading") else { return body };
        let looking: Vec<Line> = LOOKING.iter().filter_map(|key| body.get(key)).collect();
        let own = looking.iter().find(|line| !line.inherited);
        match (heading.inherited, own.or(looking.first())) {
            (_, None) => {}
            (true, Some(_)) if own.is_some() => body.lines.retain(|line| line.key != "heading"),
            (false, Some(_)) if own.is_none() => body.lines.retain(|line| !LOOKING.contains(&line.key)),
            (_, Some(other)) => {
                let (first, second) = match heading.key_span.start < other.key_span.start {
                    true => (heading, *other),
                    false => (*other, heading),
                };
                let message = format!("`{}` and `{}` exclude each other", second.key, first.key);
                let fault = Diagnostic::error("V01", second.span(), message).label("say only one of them");
                self.report(fault.note(first.span(), format!("`{}` is said here", first.key)));
                body.lines.retain(|line| line.key != "heading");
                body.faulty.insert("heading");
            }
        }
        body
    }

    /// The detector's block, held against what the model declares.
    fn detector(&mut self, body: &Body<'a>) -> Option<ModelUse> {
        let line = body.get("ccd")?;
        self.surplus(&line, line.items, 0);
        let info = self.model(Role::Detector, "ccd", line.key_span)?;
        Some(self.model_use(Role::Detector, &info, line.key_span, None, line.block, None))
    }

    /// Reports an exposure that outlasts the time in which a scanner must read its pixels out, `rate` times a second.
    fn exposure_fits(&mut self, body: &Body<'a>, ccd: &ModelUse, rate: f64) {
        let (Some(exposure), Some(place)) = (ccd.args.number("exposure"), ccd.param_spans.get("exposure")) else {
            return;
        };
        if exposure * rate > 1.0 + 1e-9 {
            // Rounded down, so that what is proposed fits.
            let digits = 10f64.powf(2.0 - (1e3 / rate).log10().floor());
            let each = super::value::written((1e3 / rate * digits * (1.0 + 1e-12)).floor() / digits);
            let message = format!(
                "an exposure of {} ms outlasts the {each} ms in which this scanner reads a pixel",
                super::value::written(exposure * 1e3)
            );
            let fault = Diagnostic::error("V01", *place, message).label(format!("at most {each} ms?"));
            let rate = body.get("line_rate").map(|line| line.span());
            self.report(rate.into_iter().fold(fault, |fault, place| fault.note(place, "the line rate")));
        }
    }

    fn sensor_pose(&mut self, body: &Body<'a>, site: Option<Site>, scans: bool, owner: &Owner) -> Option<SensorPose> {
        const FORMS: &str = "`position` and `look_at`; `position` with `heading`, `depression`; or `look_at`, `altitude`, \
                             `view_zenith`, `view_azimuth`";
        let said = |key: &str| body.get(key).is_some() || body.faulty.contains(key);
        let from_target = FROM_TARGET.iter().any(|key| said(key));
        let lacking: Vec<&str> = if from_target {
            ["look_at", "altitude", "view_zenith", "view_azimuth"].into_iter().filter(|key| !said(key)).collect()
        } else {
            ["position"].into_iter().filter(|key| !said(key)).collect()
        };
        if !lacking.is_empty() {
            if !body.obscure && !self.spoilt(owner.extent) {
                let lacks: Vec<String> = lacking.iter().map(|key| format!("`{key}`")).collect();
                let message = format!("this sensor has no pose: {} is missing", lacks.join(", "));
                let fault = Diagnostic::error("V01", owner.span, message);
                self.report(fault.label(format!("{}?", lacks.join(", "))).help(format!("a pose is {FORMS}")));
            }
            return None;
        }
        let tilt = Quantity::new(Dimension::Angle);
        // A scanner may look ahead or back, but not along its flight.
        let tilt = if scans { tilt.positive(PI).below(PI) } else { tilt.within(-FRAC_PI_2, FRAC_PI_2) };
        if from_target {
            let look_at = body.get("look_at").and_then(|line| self.vector3(&line, &COORDINATE));
            let altitude = self.optional(body.get("altitude"), &Quantity::new(Dimension::Length).within(-1e4, 1e9));
            let zenith = Quantity::new(Dimension::Angle).within(0.0, 0.0).below(FRAC_PI_2);
            let view_zenith = self.optional(body.get("view_zenith"), &zenith);
            let view_azimuth = self.optional(body.get("view_azimuth"), &TURN);
            let (look_at, altitude) = (look_at?, altitude?);
            let height = altitude - site.map_or(0.0, |site| site.elevation);
            if height <= look_at.z
                && let Some(line) = body.get("altitude")
            {
                let message = "this sensor is not above what it looks at: its altitude counts from sea level";
                let above = super::value::written(look_at.z + site.map_or(0.0, |site| site.elevation));
                self.report(Diagnostic::error("V02", line.span(), message).label(format!("above {above} m?")));
                return None;
            }
            return Some(SensorPose::Target {
                look_at,
                altitude,
                view_zenith: view_zenith?,
                view_azimuth: view_azimuth?,
            });
        }
        let position = body.get("position").and_then(|line| self.vector3(&line, &COORDINATE));
        let roll = body.get("roll").map_or(Some(0.0), |line| self.quantity(&line, &TURN));
        if let Some(line) = body.get("look_at") {
            if let Some(roll) = body.get("roll").filter(|_| scans) {
                let message = "a scanner that looks at a point is rolled so that it does";
                let fault = Diagnostic::error("V01", roll.span(), message).label("leave it out");
                self.report(fault.note(line.span(), "what it looks at"));
                return None;
            }
            let look_at = self.vector3(&line, &COORDINATE);
            let (position, look_at) = (position?, look_at?);
            if position == look_at {
                let fault = Diagnostic::error("V02", line.span(), "this sensor stands at the point that it looks at");
                let note = body.get("position").map(|line| line.span());
                let fault = fault.label("another point?");
                self.report(note.into_iter().fold(fault, |fault, place| fault.note(place, "it stands here")));
                return None;
            }
            return Some(SensorPose::LookAt { position, look_at, roll: roll? });
        }
        if body.faulty.contains("look_at") {
            return None;
        }
        let heading = body.get("heading").map_or(Some(0.0), |line| self.quantity(&line, &TURN));
        let depression = body.get("depression").map_or(Some(FRAC_PI_2), |line| self.quantity(&line, &tilt));
        Some(SensorPose::Attitude { position: position?, heading: heading?, depression: depression?, roll: roll? })
    }

    fn optics(
        &mut self,
        body: &Body<'a>,
        projection: Projection,
        ccd: Option<&ModelUse>,
        owner: &Owner,
    ) -> Option<Optics> {
        const PERSPECTIVE: [&str; 3] = ["field_of_view", "ifov", "focal_length"];
        const ORTHOGRAPHIC: [&str; 2] = ["swath", "ground_sample"];
        let (own, other): (&[&str], &[&str]) = match projection {
            Projection::Orthographic => (&ORTHOGRAPHIC, &PERSPECTIVE),
            _ => (&PERSPECTIVE, &ORTHOGRAPHIC),
        };
        let name = match projection {
            Projection::Perspective => "a perspective camera",
            Projection::Orthographic => "an orthographic camera",
            Projection::Pushbroom => "a pushbroom scanner",
            Projection::Whiskbroom => "a whiskbroom scanner",
        };
        if let Some(line) = other.iter().find_map(|key| body.get(key)) {
            let message = format!("{name} has no `{}`", line.key);
            self.report(Diagnostic::error("V01", line.span(), message).label(format!("{}?", own.join(", "))));
            return None;
        }
        let Some(line) = own.iter().find_map(|key| body.get(key)) else {
            if !own.iter().chain(other).any(|key| body.said(key)) {
                let form = if projection == Projection::Orthographic { "swath 100 m" } else { "field_of_view 30 deg" };
                let message = format!("this sensor has no optics: one of {} is missing", own.join(", "));
                self.missing("V01", &message, form, owner);
            }
            return None;
        };
        let view = Quantity::new(Dimension::Angle).positive(PI).below(PI);
        Some(match line.key {
            "field_of_view" => Optics::FieldOfView(self.quantity(&line, &view)?),
            "ifov" => Optics::Ifov(self.quantity(&line, &view.usual("mrad"))?),
            "swath" => Optics::Swath(self.quantity(&line, &SIZE)?),
            "ground_sample" => Optics::GroundSample(self.quantity(&line, &SIZE)?),
            _ => {
                let focal_length = self.quantity(&line, &SIZE.usual("mm"));
                let Some(pitch) = ccd.and_then(|ccd| ccd.args.number("pitch")) else {
                    let block = body.get("ccd").and_then(|ccd| ccd.block);
                    if block.is_some_and(|block| block.statements.iter().any(|said| said.key.text == "pitch")) {
                        return None; // what is wrong with it has been said
                    }
                    let message = "a focal length needs the pitch of the detector's pixels";
                    let fault = Diagnostic::error("V01", line.span(), message).label("`ccd { pitch 9.9 um }`?");
                    self.report(fault.help("or give `field_of_view` or `ifov` in its place"));
                    return None;
                };
                Optics::FocalLength { focal_length: focal_length?, pitch }
            }
        })
    }

    fn bands(&mut self, body: &Body<'a>, owner: &Owner) -> Vec<Bands> {
        if !body.said("band") && !body.said("bands") {
            self.missing("S05", "a sensor needs a band", "band NAME 600..700 nm", owner);
        }
        let mut names: BTreeMap<String, Span> = BTreeMap::new();
        let mut out = Vec::new();
        for line in &body.lines {
            let band = match line.key {
                "band" => self.band(line, &mut names),
                "bands" => self.band_set(line, &mut names),
                _ => None,
            };
            out.extend(band);
        }
        out
    }

    fn band_name(&mut self, names: &mut BTreeMap<String, Span>, name: &str, span: Span) {
        if let Some(first) = names.get(name) {
            let first = *first;
            let fault = Diagnostic::error("V03", span, format!("this sensor has two bands `{name}`"));
            self.report(fault.label("another name?").note(first, "the first"));
        } else if crate::parse::spelling::is_unit(name) || super::block::is_connective(name) {
            let fault = Diagnostic::error("N03", span, format!("`{name}` is a unit or a word of the language"));
            self.report(fault.label(format!("`{name}_1`?")));
        } else {
            names.insert(name.to_string(), span);
        }
    }

    fn band(&mut self, line: &Line<'a>, names: &mut BTreeMap<String, Span>) -> Option<Bands> {
        let (items, clauses) = self.clauses(line);
        let span = line.span();
        let Some(Item { value: Value::Word(name), span: name_span }) = items.first() else {
            self.absent(line, "the band's name");
            return None;
        };
        self.band_name(names, name, *name_span);
        let name = name.clone();
        let forms = [items.len() > 1, clauses.said("centre") || clauses.said("fwhm"), clauses.said("response")];
        match forms.iter().filter(|form| **form).count() {
            0 => {
                self.absent(line, "a range, `centre … fwhm …` or `response FILE`");
                return None;
            }
            1 => {}
            _ if clauses.obscure => return None,
            _ => {
                let message = format!("the band `{name}` is given in two ways");
                self.report(Diagnostic::error("S05", span, message).label("edges, centre and width, or a response"));
                return None;
            }
        }
        if let Some(item) = items.get(1) {
            let given = self.resolve(item, &[]);
            let (lower, upper) = self.range_of(line, &given, &WAVELENGTH)?;
            self.surplus(line, items, 2);
            return Some(Bands::Edges { name, lower, upper, span });
        }
        if let Some(clause) = clauses.get("response") {
            let Some(item) = clause.items.first() else {
                self.absent(&clause, "a file, named in quotes");
                return None;
            };
            let file = self.scene_file(&clause, item)?;
            self.surplus(&clause, clause.items, 1);
            return Some(Bands::Response { name, file, span });
        }
        for key in ["centre", "fwhm"] {
            if !clauses.said(key) {
                let owner = Owner::new("a band", line);
                self.missing(
                    "S05",
                    &format!("the band `{name}` lacks `{key}`"),
                    "centre WAVELENGTH fwhm WAVELENGTH",
                    &owner,
                );
            }
        }
        let centre = self.optional(clauses.get("centre"), &WAVELENGTH);
        let fwhm = self.optional(clauses.get("fwhm"), &BANDWIDTH);
        Some(Bands::Gaussian { name, centre: centre?, fwhm: fwhm?, span })
    }

    fn band_set(&mut self, line: &Line<'a>, names: &mut BTreeMap<String, Span>) -> Option<Bands> {
        let (items, clauses) = self.clauses(line);
        let span = line.span();
        let Some(item) = items.first() else {
            self.absent(line, "a set, a file, or a range");
            return None;
        };
        let given = self.resolve(item, &[]);
        let series = matches!(given.value, Value::Range { .. });
        for (key, due) in [("only", !series), ("every", series), ("fwhm", series)] {
            if let Some(clause) = clauses.get(key)
                && !due
            {
                let belongs = if series { "a set or a file" } else { "a range" };
                let message = format!("`{key}` belongs to the bands of {belongs}");
                self.report(Diagnostic::error("S05", clause.span(), message).label("leave it out"));
                return None;
            }
        }
        if series {
            let owner = Owner::new("`bands`", line);
            for key in ["every", "fwhm"] {
                if !clauses.said(key) {
                    self.missing(
                        "S05",
                        &format!("a series of bands needs `{key}`"),
                        "every WAVELENGTH fwhm WAVELENGTH",
                        &owner,
                    );
                }
            }
            let range = self.range_of(line, &given, &WAVELENGTH);
            self.surplus(line, items, 1);
            let every = self.optional(clauses.get("every"), &BANDWIDTH);
            let fwhm = self.optional(clauses.get("fwhm"), &BANDWIDTH);
            let ((lower, upper), every, fwhm) = (range?, every?, fwhm?);
            if (upper - lower) / every > MOST_BANDS {
                let message = format!("this series has {:.0} bands", (upper - lower) / every);
                self.report(Diagnostic::error("U05", span, message).label(format!("at most {MOST_BANDS}")));
                return None;
            }
            return Some(Bands::Series { lower, upper, every, fwhm, span });
        }
        let only = match clauses.get("only") {
            Some(clause) => Some(self.only(&clause, names)?),
            None => None,
        };
        match given.value {
            Value::Word(set) => {
                self.surplus(line, items, 1);
                Some(Bands::Set { set: set.clone(), only, span })
            }
            Value::Text(_) => {
                let file = self.scene_file(line, item)?;
                self.surplus(line, items, 1);
                Some(Bands::FileSet { file, only, span })
            }
            _ => {
                self.wrong(line, &given, "a set, a file, or a range");
                None
            }
        }
    }

    fn only(&mut self, line: &Line<'a>, names: &mut BTreeMap<String, Span>) -> Option<Vec<String>> {
        let Some(item) = line.items.first() else {
            self.absent(line, "names of bands");
            return None;
        };
        let members = self.members(line, item)?;
        if members.is_empty() {
            self.report(Diagnostic::error("X01", item.span, "`only` selects no band").label("leave it out for all"));
            return None;
        }
        let mut out: Vec<String> = Vec::new();
        for member in members {
            let Value::Word(name) = &member.value else {
                let given = self.resolve(member, &[]);
                self.wrong(line, &given, "the name of a band");
                return None;
            };
            self.band_name(names, name, member.span);
            out.push(name.clone());
        }
        self.surplus(line, line.items, 1);
        Some(out)
    }
}
