//! One line of a log: what stands before the sentence, the sentence, and whether it is whole.

use crate::stamp;

/// The longest sentence that is taken. The standard says 82 characters with the line's end; receivers
/// with centimetres write longer positions.
pub(super) const LONGEST: usize = nmea::SENTENCE_MAX_LEN;

/// Why a line was left out, in words that complete "Left out: 3 ...".
pub(super) mod reason {
    pub(crate) const TOO_LONG: &str =
        "line(s) longer than any NMEA sentence (102 characters); the log has other data in it";
    pub(crate) const CHECKSUM: &str =
        "NMEA sentence(s) with a wrong checksum; the line was disturbed";
    pub(crate) const CUT_OFF: &str = "NMEA sentence(s) cut off before their checksum";
    pub(crate) const GARBLED: &str =
        "NMEA sentence(s) whose fields are not as the standard has them";
    pub(crate) const NO_SENTENCE: &str = "line(s) that are no NMEA sentence";
    pub(crate) const NO_TIME: &str = "NMEA sentence(s) before the first time of the log or long after its last; nobody knows when they were";
    pub(crate) const NO_POSITION: &str =
        "second(s) of the receiver without a position: no satellites yet, or lost";
}

/// A sentence whose checksum, if it has one, is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sentence<'a> {
    /// When the line arrived, ns since 1970, where the log says so.
    pub(super) arrival_ns: Option<i64>,
    /// What stands between `$` and `*`.
    pub(super) body: &'a str,
    pub(super) has_checksum: bool,
}

impl<'a> Sentence<'a> {
    /// Takes a line apart; `None` for lines that say nothing: empty ones, remarks, and reports of other
    /// ships.
    pub(super) fn of_line(line: &'a [u8]) -> Result<Option<Self>, &'static str> {
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") {
            return Ok(None);
        }
        // Where two sentences ran into each other the second one is whole.
        let Some(start) = line.iter().rposition(|byte| *byte == b'$') else {
            let is_ais = line.contains(&b'!');
            return if is_ais {
                Ok(None)
            } else {
                Err(reason::NO_SENTENCE)
            };
        };
        let (before, sentence) = line.split_at(start);
        if sentence.len() > LONGEST {
            return Err(reason::TOO_LONG);
        }
        let text = std::str::from_utf8(&sentence[1..]).map_err(|_| reason::GARBLED)?;
        let (body, checksum) = match text.split_once('*') {
            Some((body, checksum)) => (body, Some(checksum)),
            None => (text, None),
        };
        if let Some(written) = checksum {
            let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
            if written.len() != 2 {
                return Err(reason::CUT_OFF);
            }
            if u8::from_str_radix(written, 16) != Ok(sum) {
                return Err(reason::CHECKSUM);
            }
        }
        Ok(Some(Self {
            arrival_ns: arrival(before),
            body,
            has_checksum: checksum.is_some(),
        }))
    }

    /// The talker and the kind of the sentence: what stands before the first comma.
    pub(super) fn address(&self) -> &'a str {
        self.body.split(',').next().unwrap_or_default()
    }

    /// The fields behind the address.
    pub(super) fn fields(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.body.split(',').skip(1)
    }
}

/// The time before a sentence: a date and time of day, seconds since 1970, or a tag block.
pub(crate) fn arrival(before: &[u8]) -> Option<i64> {
    let text = before.trim_ascii();
    if let Some(block) = text.strip_prefix(b"\\") {
        let fields = block.split(|byte| matches!(byte, b',' | b'*' | b'\\'));
        let time = fields
            .filter_map(|field| field.strip_prefix(b"c:"))
            .next()?;
        // Seconds or, as some write, milliseconds.
        let exponent = if time.len() > 11 { 6 } else { stamp::SECONDS };
        return stamp::parse_ns(time, exponent);
    }
    stamp::parse_date_time(text).or_else(|| stamp::parse_ns(text, stamp::SECONDS))
}

/// Whether a text begins as a log of sentences does.
pub(crate) fn recognises(head: &str) -> bool {
    /// Lines that are looked at: a log may begin within a sentence.
    const LINES: usize = 20;
    let is_sentence = |line: &str| {
        let Some(start) = line.rfind(['$', '!']) else {
            return false;
        };
        let before = line[..start].trim();
        let address = line[start + 1..].split(',').next().unwrap_or_default();
        let has_fields = line[start + 1..].contains(',');
        has_fields
            && (4..=8).contains(&address.len())
            && address
                .bytes()
                .all(|b| b.is_ascii_uppercase() || b.is_ascii_digit())
            && (before.is_empty()
                || before.starts_with('\\')
                || arrival(before.as_bytes()).is_some())
    };
    head.lines().take(LINES).any(is_sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_before_a_sentence_is_its_arrival() {
        for before in [
            "2014-08-01T00:00:00.186000Z ",
            "1406851200.186 ",
            "\\s:r1,c:1406851200186*3F\\",
        ] {
            let line = format!("{before}$HEHDT,218.53,T*12\r\n");
            let sentence = Sentence::of_line(line.as_bytes()).unwrap().unwrap();
            assert_eq!(sentence.arrival_ns, Some(1_406_851_200_186_000_000));
            assert_eq!((sentence.address(), sentence.has_checksum), ("HEHDT", true));
            assert_eq!(sentence.fields().collect::<Vec<_>>(), ["218.53", "T"]);
            assert!(recognises(&line), "{line}");
        }
    }

    #[test]
    fn every_kind_of_damage_has_its_reason() {
        let long = format!("$GPTXT,{}", "x".repeat(100));
        for (line, reason) in [
            ("$HEHDT,218.53,T*13", reason::CHECKSUM),
            ("$HEHDT,218.63,T*12", reason::CHECKSUM),
            ("$HEHDT,218.53,T*1", reason::CUT_OFF),
            ("$HEHDT,218.53,T*zz", reason::CHECKSUM),
            ("HEHDT,218.53,T*12", reason::NO_SENTENCE),
            (long.as_str(), reason::TOO_LONG),
        ] {
            assert_eq!(Sentence::of_line(line.as_bytes()), Err(reason), "{line}");
        }
        let garbled = Sentence::of_line(b"$HEHDT,218.\xff3,T*12");
        assert_eq!(garbled, Err(reason::GARBLED));
        for silent in ["", "\r\n", "# a remark", "!AIVDM,1,1,,B,15,0*4D"] {
            assert_eq!(Sentence::of_line(silent.as_bytes()), Ok(None), "{silent}");
        }
        // The first sentence lost its end; the second is whole.
        let merged = b"$GPGGA,1234,48$HEHDT,218.53,T*12";
        let sentence = Sentence::of_line(merged).unwrap().unwrap();
        assert_eq!(sentence.address(), "HEHDT");
    }

    #[test]
    fn tables_are_no_logs() {
        for text in [
            "t_s,gyro_x_rad_s\n0,1\n",
            "price,in\n$5,x\n",
            "a,b\n1,2\n",
            "",
        ] {
            assert!(!recognises(text), "{text}");
        }
    }
}
