//! Plain rooms without a special difficulty.

use crate::room::generated::furnisher::Furnisher;

/// Shell, one to five lamps, up to fourteen pieces of furniture, four to twelve views.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    f.look_around(4, 12);
    f.expose(8.0, 64.0);
}
