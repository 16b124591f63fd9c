#include "scripts/mission/run_again.hpp"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>

#include "core/base/units.hpp"
#include "core/base/version.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/sha256.hpp"
#include "core/sim/run_header.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

class Reader {
 public:
  explicit Reader(const std::string& path) : file_(Hdf5File::open(path)) {}

  RecordedRun read() {
    RecordedRun run;
    if (!file_.has("/spec/files") || !file_.has("/run/command"))
      wrong("/spec/files", "the texts of the input files", "results without them", "only results of cardan run can be repeated");
    auto inputs = std::make_shared<RecordedInputs>();
    inputs->results = file_.file_name();
    const Pairs files = pairs("/spec/files"), hashes = pairs("/run/inputs");
    for (std::size_t i = 0; i < files.size(); ++i) {
      const auto& [name, text] = files[i];
      if (i >= hashes.size() || hashes[i].first != name || hashes[i].second != sha256(text))
        wrong("/spec/files", "texts that have the recorded hashes", in_quotes(name) + " has another",
              "the results were changed after the run");
      inputs->texts[name] = text;
    }
    for (const char* path : {"/run/plugins", "/run/modal_files"})
      for (const auto& [name, hash] : pairs(path)) inputs->hashes[name] = hash;
    run.inputs = inputs;
    run.command = file_.read_texts("/run/command");
    run.options.file = std::filesystem::path(text("folder")) / text("scenario");
    run.options.recorded = inputs;
    for (const auto& [key, value] : pairs("/run/settings")) run.options.settings.push_back({key, value});
    const auto seed = parse_seed(text("seed"));
    if (!seed) wrong("/run@seed", "a whole number from 0 to 18446744073709551615", in_quotes(text("seed")), {});
    run.options.seed = *seed;
    if (file_.has_attribute("/run", "until") && !(run.until = parse_number(text("until"))))
      wrong("/run@until", "a time in s", in_quotes(text("until")), {});
    run.check_against_reference = text("check_against_reference") == "true";
    compare("cardan", text("program_version") + " " + text("commit"), fmt::format("{} {}", version::kNumber, version::kCommit), run);
    compare("compiler", text("compiler") + ", " + text("flags"), fmt::format("{}, {}", version::kCompiler, version::kFlags), run);
    compare("sweeps", text("sweeps"), sweeps_name(), run);
    return run;
  }

 private:
  std::string text(const char* key) const { return file_.text_attribute("/run", key); }

  Pairs pairs(const std::string& path) const {
    Pairs out;
    const std::vector<std::string> texts = file_.read_texts(path);
    for (std::size_t i = 0; i + 1 < texts.size(); i += 2) out.emplace_back(texts[i], texts[i + 1]);
    return out;
  }

  [[noreturn]] void wrong(const char* path, std::string expected, std::string got, std::string hint) const {
    throw InputError(Diagnostic{Code::bad_result_file, {path, {file_.file_name()}}, std::move(expected), std::move(got), std::move(hint)});
  }

  void compare(const char* what, const std::string& then, const std::string& now, RecordedRun& run) const {
    if (then == now) return;
    run.warnings.add(
        Code::other_program, {what, {file_.file_name(), 0, 0}},
        fmt::format("the run was made by another program: then {}, now {}", then, now),
        what == std::string_view("sweeps") ? "CARDAN_KERNELS chooses the instruction set: v2, v3, v4" : "the last bits may differ");
  }

  Hdf5File file_;
};

}  // namespace

std::optional<std::uint64_t> parse_seed(std::string_view text) {
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(seed) : std::nullopt;
}

RecordedRun read_recorded_run(const std::string& h5_path) {
  const auto probe = [&h5_path] {  // what breaks the library that reads it breaks it here
    Reader(h5_path).read();
    return std::string();
  };
  in_bounded_child(h5_path, probe, limits_for_file(h5_path));
  return Reader(h5_path).read();
}

}  // namespace cardan
