#include "core/io/run_columns.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/result_folder.hpp"

namespace cardan {
namespace {

const std::string kRoot = "/channels";

[[noreturn]] void bad(const Hdf5File& file, const std::string& path, std::string expected, std::string got) {
  refuse(Code::bad_result_file, {path, {file.file_name()}}, std::move(expected), std::move(got));
}

RunColumns columns_of(const std::string& h5_path, const std::function<bool(const std::string&)>& wanted) {
  const Hdf5File file = Hdf5File::open(h5_path);
  result_format(file);
  RunColumns out;
  const auto time = file.read_doubles("/time");
  if (time.shape.size() != 1) bad(file, "/time", "one time per row", fmt::format("an array of rank {}", time.shape.size()));
  out.times = time.values;
  for (const auto& [name, text] : {std::pair{"sweeps", &out.sweeps}, {"verdict", &out.verdict}, {"why", &out.why}, {"golden", &out.golden}})
    if (file.has_attribute("/run", name)) *text = file.text_attribute("/run", name);
  // Killed in a flush by a program that wrote no /flushed: some channels may have more rows than others.
  const bool may_be_cut = file.has_attribute("/run", "started") && out.verdict.empty();
  std::size_t rows = out.times.size();
  for (const std::string& path : file.datasets(kRoot)) {
    Column c;
    c.path = path.substr(kRoot.size() + 1);
    if (wanted && !wanted(c.path)) continue;
    c.components = file.texts_attribute(path, "components");
    c.units = units_of_components(file.text_attribute(path, "unit"), c.components.size());
    auto data = file.read_doubles(path);
    if (data.shape.size() != 2 || data.shape[1] != c.components.size() || c.components.empty())
      bad(file, path, fmt::format("rows of {} numbers, one for each component", c.components.size()),
          data.shape.size() == 2 ? fmt::format("rows of {}", data.shape[1]) : fmt::format("an array of rank {}", data.shape.size()));
    if (data.shape[0] != out.times.size() && !may_be_cut)
      bad(file, path, fmt::format("{} rows, as /time has", out.times.size()), fmt::format("{}", data.shape[0]));
    rows = std::min(rows, data.shape[0]);
    c.values = std::move(data.values);
    out.columns.push_back(std::move(c));
  }
  out.times.resize(rows);
  for (Column& c : out.columns) c.values.resize(rows * c.components.size());
  return out;
}

void put(ByteWriter& out, const std::vector<std::string>& texts) {
  out.number(texts.size());
  for (const std::string& text : texts) out.text(text);
}
void put(ByteWriter& out, const std::vector<double>& numbers) {
  out.number(numbers.size());
  out.raw(numbers.data(), numbers.size() * sizeof(double));
}
std::vector<std::string> words_of(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}
std::vector<std::string> take_texts(ByteReader& in) {
  std::vector<std::string> out(std::min(in.number(), in.left()));
  for (std::string& text : out) text = in.text();
  return out;
}
std::vector<double> take_numbers(ByteReader& in) {
  const std::size_t n = in.number();
  if (n > in.left() / sizeof(double)) throw std::out_of_range("columns");
  std::vector<double> out(n);
  in.raw(out.data(), n * sizeof(double));
  return out;
}

}  // namespace

const Column* RunColumns::find(std::string_view path) const {
  const auto found = std::ranges::find(columns, path, &Column::path);
  return found == columns.end() ? nullptr : &*found;
}

std::string unit_of_channel(std::vector<std::string> units) {
  if (units.empty()) return "1";
  const bool equal = std::ranges::all_of(units, [&](const std::string& unit) { return unit == units.front(); });
  if (equal && (units.size() == 1 || words_of(units.front()).size() != units.size())) return units.front();
  for (std::string& unit : units) unit = fmt::format("{}", fmt::join(words_of(unit), "*"));
  return fmt::format("{}", fmt::join(units, " "));
}

std::vector<std::string> units_of_components(const std::string& unit, std::size_t components) {
  std::vector<std::string> units = words_of(unit);
  // Results of before wrote "Nm", and two torques as "N m".
  if (units.size() != components || components == 1 || unit == "N m") return std::vector<std::string>(components, unit);
  for (std::string& one : units) {
    std::ranges::replace(one, '*', ' ');
    if (one == "Nm") one = "N m";
  }
  return units;
}

ChannelPart part_of_channel(const std::string& name, const std::vector<std::string>& channels,
                            const std::function<std::vector<std::string>(const std::string& channel)>& components_of,
                            const std::string& file) {
  const auto refuse_among = [&](const std::string& of, const std::vector<std::string>& legal) {
    refuse(Code::unknown_name, {of, {file}}, fmt::format("one of: {}", fmt::join(legal, ", ")), '"' + name + '"',
           did_you_mean(name, legal));
  };
  const auto is_channel = [&](const std::string& path) { return std::ranges::find(channels, path) != channels.end(); };
  const auto dot = name.rfind('.');
  ChannelPart part{is_channel(name) || dot == std::string::npos ? name : name.substr(0, dot), {}};
  if (!is_channel(part.channel)) refuse_among(kRoot, channels);
  const std::vector<std::string> components = components_of(part.channel);
  for (std::size_t k = 0; k < components.size(); ++k)
    if (part.channel == name || components[k] == name.substr(dot + 1)) part.components.push_back(k);
  if (part.components.empty()) refuse_among(kRoot + "/" + part.channel, components);
  return part;
}

RunColumns read_run_columns(const std::string& h5_path, const std::function<bool(const std::string&)>& wanted) {
  if (std::error_code none; !std::filesystem::is_regular_file(h5_path, none))
    refuse(Code::file_not_found, {"", {h5_path}}, "results: run.h5, or the folder it is in", "no such file");
  RunColumns out;
  read_between_flushes(h5_path, [&] {
    const std::string bytes = in_bounded_child(
        h5_path,
        [&] {
          const RunColumns read = columns_of(h5_path, wanted);
          ByteWriter to;
          for (const std::string* text : {&read.sweeps, &read.verdict, &read.why, &read.golden}) to.text(*text);
          put(to, read.times);
          to.number(read.columns.size());
          for (const Column& c : read.columns) {
            to.text(c.path);
            put(to, c.components);
            put(to, c.units);
            put(to, c.values);
          }
          return to.take();
        },
        limits_for_file(h5_path));
    ByteReader in(bytes);
    out = {};
    out.file = h5_path;
    for (std::string* text : {&out.sweeps, &out.verdict, &out.why, &out.golden}) *text = in.text();
    out.times = take_numbers(in);
    out.columns.resize(std::min(in.number(), bytes.size()));
    for (Column& c : out.columns) {
      c.path = in.text();
      c.components = take_texts(in);
      c.units = take_texts(in);
      c.values = take_numbers(in);
    }
  });
  return out;
}

void write_packed_columns(const std::string& h5_path, const RunColumns& run,
                          const std::vector<std::pair<std::string, std::string>>& about) {
  const std::filesystem::path before = name_before(h5_path);
  try {
    Hdf5File file = Hdf5File::create(before.string());
    file.make_group("/run");
    for (const auto& [key, text] : about) file.set_attribute("/run", key, text);
    file.write_packed("/time", run.times, {run.times.size()});
    file.set_attribute("/time", "unit", std::string("s"));
    for (const Column& c : run.columns) {
      const std::string path = kRoot + "/" + c.path;
      file.write_packed(path, c.values, {run.times.size(), c.components.size()});
      file.set_attribute(path, "components", c.components);
      file.set_attribute(path, "unit", unit_of_channel(c.units));
    }
    file.close();
    file.rename(h5_path);
  } catch (const std::exception& e) {
    std::error_code ignored;
    std::filesystem::remove(before, ignored);
    if (const auto* full = dynamic_cast<const NumericsError*>(&e))
      refuse(Code::cannot_write, {{}, {h5_path}}, "a file that can be written", full->failure().what, full->failure().hint);
    throw;
  }
}

}  // namespace cardan
