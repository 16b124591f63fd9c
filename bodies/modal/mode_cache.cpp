#include "bodies/modal/mode_cache.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <random>
#include <stdexcept>
#include <vector>

#include "bodies/modal/modal_file.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/sha256.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kKind = "cardan-modes/1 ", kEnding = ".modes", kUnfinished = ".unfinished";
constexpr auto kAbandoned = std::chrono::hours(1);  // an unfinished file of a process that did not live to rename it

/// Every member of what describes a source, in order. A member that is added breaks the bindings: it has to be taken in.
class Content {
 public:
  void add(double x) { bytes_.raw(&x, sizeof x); }
  void add(int x) { bytes_.number(static_cast<std::size_t>(x)); }
  void add(bool x) { bytes_.number(x); }
  void add(const std::string& x) { bytes_.text(x); }
  template <int R, int C>
  void add(const Eigen::Matrix<double, R, C>& x) {
    for (double value : x.reshaped()) add(value);
  }
  template <class T>
  void add(const std::vector<T>& list) {
    bytes_.number(list.size());
    for (const T& item : list) add(item);
  }
  template <class... T>
  void add(const std::variant<T...>& x) {
    bytes_.number(x.index());
    std::visit([&](const auto& value) { add(value); }, x);
  }
  void add(const Material& x) {
    const auto& [E, nu, rho] = x;
    all(E, nu, rho);
  }
  void add(const BeamSection& x) {
    const auto& [area, Iy, Iz, J, shear_y, shear_z] = x;
    all(area, Iy, Iz, J, shear_y, shear_z);
  }
  void add(const BeamModel& x) {
    const auto& [length, material, section, elements, rotary] = x;
    all(length, material, section, elements, rotary);
  }
  void add(const SolidPanel& x) {
    const auto& [material, thickness] = x;
    all(material, thickness);
  }
  void add(const SandwichPanel& x) {
    const auto& [face, face_thickness, core_thickness, core_density, added_mass] = x;
    all(face, face_thickness, core_thickness, core_density, added_mass);
  }
  void add(const Yoke& x) {
    const auto& [length, spread, material, section] = x;
    all(length, spread, material, section);
  }
  void add(const PlateModel& x) {
    const auto& [length, width, panel, elements_x, elements_y, rotary, yoke] = x;
    all(length, width, panel, elements_x, elements_y, rotary, yoke);
  }
  void add(const LumpedModel&) {}  // these two are not kept
  void add(const FileModel&) {}
  void add(const MatrixModel& x) {
    const auto& [nodes, mass, stiffness, damping, root, place, component_modes] = x;
    for (const std::string* file : {&nodes, &mass, &stiffness, &damping}) add(file->empty() ? std::string() : sha256_of_file(*file));
    all(name_of(mass), name_of(stiffness), root, place, component_modes);
  }
  void add(const NodeSet& x) {
    const auto& [numbers, group, within, normal, at_mean, names] = x;
    all(numbers, group, within, normal, at_mean, names);
  }
  void add(const SolidModel& x) {
    const auto& [mesh, units, material, root, place] = x;
    all(sha256_of_file(mesh), name_of(mesh), static_cast<int>(units), material, root, place);
  }
  void add(const ModeChoice& x) {
    const auto& [count, max_frequency, effective_mass] = x;
    all(count.value_or(-1), max_frequency, effective_mass);
  }
  void add(const NamedPoint& x) {
    const auto& [name, position, interface, R_BN, nodes] = x;
    all(name, position, interface, R_BN, nodes);
  }
  void add(const PointMass& x) {
    const auto& [mass, position, inertia, nodes] = x;
    all(mass, position, inertia, nodes);
  }
  void add(const ModalSource& x) {
    const auto& [model, boundary, modes, damping, points, masses, at] = x;  // errors point to `at`, nothing depends on it
    all(model, static_cast<int>(boundary), modes, damping, points, masses);
  }
  template <class... T>
  void all(const T&... x) {
    (add(x), ...);
  }
  std::string hash() { return sha256(bytes_.take()); }

 private:
  /// Modes tell which files they are of.
  static std::string name_of(const std::string& path) { return fs::path(path).filename().string(); }
  ByteWriter bytes_;
};

/// What the last bits may depend on: the block sizes of Eigen's products follow the caches, libm's functions the instructions.
std::string processor() {
  return fmt::format("{} {} {} {} {} {}", Eigen::l1CacheSize(), Eigen::l2CacheSize(), Eigen::l3CacheSize(),
                     bool(__builtin_cpu_supports("fma")), bool(__builtin_cpu_supports("avx2")), bool(__builtin_cpu_supports("avx512f")));
}

/// Texts of a warning, its place below that of the source.
constexpr std::string Diagnostic::*kTexts[] = {&Diagnostic::expected, &Diagnostic::got, &Diagnostic::hint, &Diagnostic::stack,
                                               &Diagnostic::about};

std::string pack(const ModalSource& source, const ModalData& data, const Warnings& warnings) {
  ByteWriter bytes;
  bytes.text(data.content_hash);
  bytes.text(modal_bytes(data));
  bytes.number(warnings.all().size());
  for (const Warning& w : warnings.all()) {
    if (!w.what.at.key_path.starts_with(source.at.key_path) || w.count != 1) throw std::invalid_argument("a warning about something else");
    bytes.number(static_cast<std::size_t>(w.what.code));
    bytes.text(w.what.at.key_path.substr(source.at.key_path.size()));
    for (const auto text : kTexts) bytes.text(w.what.*text);
  }
  return bytes.take();
}

void unpack(const std::string& content, const ModalSource& source, ModalData& data, Warnings& warnings) {
  ByteReader bytes(content);
  const std::string hash = bytes.text();
  data = modal_data_of_bytes(bytes.text());
  data.content_hash = content_hash(data);
  if (data.content_hash != hash) throw std::invalid_argument("other modes");
  for (std::size_t n = bytes.number(); n > 0; --n) {
    Diagnostic d{static_cast<Code>(bytes.number()), source.at, "", "", "", "", "", 0};
    d.at.key_path += bytes.text();
    for (const auto text : kTexts) d.*text = bytes.text();
    warnings.add(std::move(d));
  }
}

}  // namespace

ModeCache ModeCache::of_user() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value ? value : "");
  };
  if (const fs::path wish = variable("CARDAN_CACHE"); !wish.empty()) return wish == "off" ? ModeCache() : ModeCache(wish);
  const fs::path cache = variable("XDG_CACHE_HOME"), home = variable("HOME");
  if (cache.is_absolute()) return ModeCache(cache / "cardan" / "modes");  // relative ones are to be ignored
  return home.is_absolute() ? ModeCache(home / ".cache" / "cardan" / "modes") : ModeCache();
}

std::string ModeCache::name_of(const ModalSource& source) {
  if (std::holds_alternative<LumpedModel>(source.model) || std::holds_alternative<FileModel>(source.model)) return {};
  try {
    Content content;
    content.all(std::string(CARDAN_MODES_MADE_BY), processor(), source);
    return content.hash() + std::string(kEnding);
  } catch (const InputError&) {  // a file that is not there: told by who reads it
    return {};
  }
}

ModeCache::Modes ModeCache::make(const ModalSource& source, Warnings* warnings) const {
  const std::string name = folder_.empty() ? "" : name_of(source);
  if (name.empty()) return {make_modal_data(source, warnings), false};
  Modes modes;
  Warnings told;
  modes.from_cache = find(name, source, modes.data, told);
  if (!modes.from_cache) {
    modes.data = make_modal_data(source, &told);
    keep(name, source, modes.data, told);
  }
  if (warnings) warnings->add(told);
  return modes;
}

bool ModeCache::find(const std::string& name, const ModalSource& source, ModalData& data, Warnings& warnings) const {
  try {
    const fs::path file = folder_ / name;
    if (!fs::is_regular_file(file) || fs::file_size(file) > limit_) return false;
    std::ifstream in(file, std::ios::binary);
    std::string kind, hash;
    std::getline(in, kind, ' ');
    std::getline(in, hash);
    std::string content{std::istreambuf_iterator<char>(in), {}};
    if (!in || kind + ' ' != kKind || hash != sha256(content)) return false;
    ModalData found;
    Warnings told;
    unpack(content, source, found, told);
    data = std::move(found), warnings = std::move(told);
    std::error_code ignored;
    fs::last_write_time(file, fs::file_time_type::clock::now(), ignored);
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

void ModeCache::keep(const std::string& name, const ModalSource& source, const ModalData& data, const Warnings& warnings) const {
  fs::path unfinished;
  try {
    const std::string content = pack(source, data, warnings);
    if (content.size() > limit_ / 4) return;
    if (fs::create_directories(folder_)) fs::permissions(folder_, fs::perms::owner_all);
    std::random_device random;
    unfinished = folder_ / fmt::format("{:08x}{:08x}{}", random(), random(), kUnfinished);
    std::ofstream out(unfinished, std::ios::binary);
    out << kKind << sha256(content) << '\n' << content;
    out.close();
    if (!out) throw std::runtime_error("not written");
    fs::rename(unfinished, folder_ / name);
    make_room();
  } catch (const std::exception&) {
    std::error_code ignored;
    if (!unfinished.empty()) fs::remove(unfinished, ignored);
  }
}

void ModeCache::make_room() const {
  struct File {
    fs::file_time_type used;
    std::uintmax_t size;
    fs::path path;
  };
  std::vector<File> files;
  std::uintmax_t size = 0;
  std::error_code gone;  // another process may take a file away at any time
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const fs::path ending = entry.path().extension();
    if (!entry.is_regular_file(gone) || (ending != kEnding && ending != kUnfinished)) continue;
    const File file{entry.last_write_time(gone), entry.file_size(gone), entry.path()};
    if (gone) continue;
    if (ending == kUnfinished) {
      if (fs::file_time_type::clock::now() - file.used > kAbandoned) fs::remove(file.path, gone);
      continue;
    }
    size += file.size;
    files.push_back(file);
  }
  std::sort(files.begin(), files.end(), [](const File& a, const File& b) { return a.used < b.used; });
  for (auto file = files.begin(); size > limit_ && file != files.end(); ++file) {
    fs::remove(file->path, gone);
    size -= file->size;
  }
}

}  // namespace cardan
