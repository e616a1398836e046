//! Traits of those who watch a run.

/// Makes such a trait of what it is told. Each method does nothing unless it is written. Perhaps somebody (`Option`)
/// and two at once (a pair) watch, too; a question (`asks`) is answered for nobody, and by one of two answers for a pair.
macro_rules! observers {
    (
        $(#[$about:meta])*
        pub trait $observer:ident {
            $( asks {
                $(#[$asked:meta])*
                $ask:ident -> $answer:ty, usually $usual:expr, of nobody $nobody:expr, of two $both:path;
            } )?
            $( $(#[$meaning:meta])* tells $tell:ident($($what:ident: $type:ty),+); )+
        }
    ) => {
        $(#[$about])*
        pub trait $observer {
            $(
                $(#[$asked])*
                fn $ask(&self) -> $answer {
                    $usual
                }
            )?

            $(
                $(#[$meaning])*
                fn $tell(&mut self, $($what: $type),+) {
                    let _ = ($($what),+);
                }
            )+
        }

        /// Watches where there is somebody to watch.
        impl<O: $observer> $observer for Option<O> {
            $(
                fn $ask(&self) -> $answer {
                    self.as_ref().map_or($nobody, O::$ask)
                }
            )?

            $(
                fn $tell(&mut self, $($what: $type),+) {
                    if let Some(observer) = self {
                        observer.$tell($($what),+);
                    }
                }
            )+
        }

        /// Tells two observers.
        impl<A: $observer, B: $observer> $observer for (A, B) {
            $(
                fn $ask(&self) -> $answer {
                    $both(self.0.$ask(), self.1.$ask())
                }
            )?

            $(
                fn $tell(&mut self, $($what: $type),+) {
                    self.0.$tell($($what),+);
                    self.1.$tell($($what),+);
                }
            )+
        }
    };
}

pub(crate) use observers;
