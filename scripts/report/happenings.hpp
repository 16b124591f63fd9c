#pragma once
// What a run noted beside its rows, and the shapes of its modes, for the page.
#include "core/io/json.hpp"

namespace cardan {

class Hdf5File;

/// By list (phases, events, printed, warnings): [[t or null, text of each column], ...], with the columns of note_kinds(); left_out
/// {list: how many are not here}. Lists that the file does not have (of an earlier version) are empty. Throws InputError C0702.
Json happenings(const Hdf5File& file);

/// How the method went through the run, for each interval, of many for several together: t [s] of its end, shortest and longest step [s],
/// order, rejected trials. Empty lists where the file has none (of an earlier version). Throws InputError C0702.
Json step_history(const Hdf5File& file);

/// pictures [{bodies, source, size [m], frequency [Hz], points, lines, shapes}], left_out: names of bodies, modes_left_out: a number.
/// points: x, y, z of each in thousandths of size about their middle; lines: pairs of indices; shapes: of each mode x, y, z of each point
/// in thousandths of the largest displacement. Throws InputError C0702.
Json mode_shapes(const Hdf5File& file);

}  // namespace cardan
