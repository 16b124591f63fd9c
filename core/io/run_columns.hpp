#pragma once
// The channels of results as numbers in memory, read in a bounded child: what comparisons work on.
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace cardan {

/// One channel: `components.size()` numbers per row, row-major.
struct Column {
  std::string path;                            // below /channels: "bodies/bus/rate"
  std::vector<std::string> components, units;  // one unit for each component
  std::vector<double> values;
};

struct RunColumns {
  std::string file;
  std::vector<double> times;  // [s] of the rows
  std::vector<Column> columns;
  std::string sweeps;   // instruction set that made them; empty: not told
  std::string verdict;  // "passed"; empty: the run was not finished
  std::string why;      // of a recorded reference: why it was recorded,
  std::string golden;   // and by which golden file of its folder
  const Column* find(std::string_view path) const;
};

/// The unit of a channel as its text: one for all components, or one for each, separated by spaces. Within such a one products are written
/// by `*` ("N*m N*m N"), and so is one for all of just as many words as there are components ("N*m*s N*m*s N*m*s").
std::string unit_of_channel(std::vector<std::string> units);
/// Back from the text: a unit for each component.
std::vector<std::string> units_of_components(const std::string& unit, std::size_t components);

/// What a name means among channels: one of them with all its components ("bodies/bus/rate"), or one component of it ("bodies/bus/rate.y");
/// the path may have dots too. Throws InputError C0208 with all legal names, of `file` (empty: of none).
struct ChannelPart {
  std::string channel;
  std::vector<std::size_t> components;
};
ChannelPart part_of_channel(const std::string& name, const std::vector<std::string>& channels,
                            const std::function<std::vector<std::string>(const std::string& channel)>& components_of,
                            const std::string& file);

/// The times and those channels for which `wanted` is true (all of them without it) of results or of a file of their layout (/time,
/// /channels/..., docs/results.md). Throws InputError C0702 for a file that is damaged or cut short, and for a channel with other rows than
/// /time has: of a run that was killed the rows that all channels have are read.
RunColumns read_run_columns(const std::string& h5_path, const std::function<bool(const std::string& path)>& wanted = {});

/// Writes such a file, packed (deflate): `about` become attributes of /run. It takes its name when it is whole and on the disk; what was
/// there stays until then. Throws InputError C0701.
void write_packed_columns(const std::string& h5_path, const RunColumns& run, const std::vector<std::pair<std::string, std::string>>& about);

}  // namespace cardan
