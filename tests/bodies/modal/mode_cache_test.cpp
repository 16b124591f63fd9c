#include "bodies/modal/mode_cache.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <set>
#include <thread>

#include "bodies/modal/modal_file.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

/// Its modes leave out one that matters, so that there are warnings too.
ModalSource wing_with_warnings() {
  ModalSource s;
  PlateModel plate;
  plate.length = 5.0, plate.width = 2.0;
  plate.panel = SandwichPanel{{7e10, 0.3, 2700.0}, 2e-4, 0.02, 50.0, 0.5};
  plate.elements_x = 10, plate.elements_y = 4;
  plate.yoke.length = 0.8, plate.yoke.spread = 1.0;
  plate.yoke.material = {1.1e11, 0.3, 1600.0};
  plate.yoke.section = tube_section(0.03, 0.002);
  s.model = plate;
  s.modes.count = 3;
  s.points = {{"tip", {5.8, 0, 0}, false}};
  s.masses = {{1.5, {5.8, 0, 0}, Eigen::Matrix3d::Identity() * 0.1}};
  s.at = {"bodies.wing.modal", {"vehicle.yaml", 7, 3}};
  return s;
}

std::string texts(const Warnings& warnings) {
  std::string out = render(warnings);
  for (const Warning& w : warnings.all()) out += w.what.at.key_path + ":" + std::to_string(w.what.at.mark.line) + "\n";
  return out;
}

fs::path only_file(const fs::path& folder) {
  fs::path found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    EXPECT_TRUE(found.empty()) << found << " and " << entry.path();
    found = entry.path();
  }
  return found;
}

std::string content_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const fs::path& file, const std::string& content) { std::ofstream(file, std::ios::binary) << content; }

TEST(ModeCache, GivesTheSameBitsAndWarningsAsTheSolution) {
  const TemporaryFolder folder;
  const ModeCache cache(folder / "modes");
  Warnings plain, first, second;
  const ModalData solved = make_modal_data(wing_with_warnings(), &plain);
  const ModeCache::Modes kept = cache.make(wing_with_warnings(), &first), found = cache.make(wing_with_warnings(), &second);
  EXPECT_FALSE(kept.from_cache);
  EXPECT_TRUE(found.from_cache);
  for (const ModalData* data : {&kept.data, &found.data}) {
    EXPECT_EQ(data->content_hash, solved.content_hash);
    EXPECT_EQ(modal_bytes(*data), modal_bytes(solved));
  }
  EXPECT_FALSE(plain.empty());
  EXPECT_EQ(texts(first), texts(plain));
  EXPECT_EQ(texts(second), texts(plain));
}

TEST(ModeCache, KnowsASourceByItsContentAndNotByItsPlace) {
  const std::string name = ModeCache::name_of(wing_with_warnings());
  ModalSource elsewhere = wing_with_warnings();
  elsewhere.at = {"bodies.other.modal", {"another.yaml", 70, 1}};
  EXPECT_EQ(ModeCache::name_of(elsewhere), name);

  const std::vector<std::function<void(ModalSource&)>> changes = {
      [](ModalSource& s) { std::get<PlateModel>(s.model).length = std::nextafter(5.0, 6.0); },
      [](ModalSource& s) { std::get<PlateModel>(s.model).elements_y = 6; },
      [](ModalSource& s) { std::get<PlateModel>(s.model).rotary_inertia = false; },
      [](ModalSource& s) { std::get<SandwichPanel>(std::get<PlateModel>(s.model).panel).face.E *= 1.1; },
      [](ModalSource& s) { std::get<SandwichPanel>(std::get<PlateModel>(s.model).panel).added_mass = 0.0; },
      [](ModalSource& s) {
        std::get<PlateModel>(s.model).panel = SolidPanel{{7e10, 0.3, 2700.0}, 2e-4};
      },
      [](ModalSource& s) { std::get<PlateModel>(s.model).yoke.section.J *= 2; },
      [](ModalSource& s) {
        s.model = BeamModel{5.0, {7e10, 0.3, 2700.0}, tube_section(0.03, 0.002), 10, true};
      },
      [](ModalSource& s) { s.boundary = Boundary::free; },
      [](ModalSource& s) { s.modes.count = 4; },
      [](ModalSource& s) { s.modes.max_frequency = 100.0; },
      [](ModalSource& s) {
        s.damping = {0.005, 0.005, 0.005};
      },
      [](ModalSource& s) { s.points[0].name = "top"; },
      [](ModalSource& s) { s.points[0].interface = true; },
      [](ModalSource& s) { s.points.push_back(s.points[0]); },
      [](ModalSource& s) { s.masses[0].inertia(0, 1) = 1e-9; },
      [](ModalSource& s) { s.masses.clear(); }};
  std::set<std::string> names = {name};
  for (const auto& change : changes) {
    ModalSource s = wing_with_warnings();
    change(s);
    EXPECT_TRUE(names.insert(ModeCache::name_of(s)).second) << "change " << names.size();
  }
  ModalSource file;
  file.model = FileModel{"wing.h5"};
  EXPECT_EQ(ModeCache::name_of(file), "");
}

TEST(ModeCache, PassesOverWhatIsDamagedOrForeignAndReplacesIt) {
  const TemporaryFolder folder;
  const ModeCache cache(folder.path());
  Warnings told, again;
  const std::string hash = cache.make(wing_with_warnings(), &told).data.content_hash;
  const fs::path file = only_file(folder.path());
  const std::string sound = content_of(file);
  ModalSource other = wing_with_warnings();
  other.modes.count = 2;
  const TemporaryFolder elsewhere;
  ModeCache(elsewhere.path()).make(other);

  std::vector<std::string> bad = {"",
                                  "cardan-modes/1 ",
                                  sound.substr(0, sound.size() / 2),
                                  sound + "x",
                                  "some other program's file\n",
                                  content_of(only_file(elsewhere.path())).replace(0, 12, "cardan-other")};
  for (std::size_t i = 0; i < sound.size(); i += 1 + sound.size() / 40) {
    bad.push_back(sound);
    bad.back()[i] ^= 1;
  }
  for (const std::string& content : bad) {
    write(file, content);
    const ModeCache::Modes modes = cache.make(wing_with_warnings());
    EXPECT_FALSE(modes.from_cache);
    EXPECT_EQ(modes.data.content_hash, hash);
    EXPECT_EQ(content_of(file), sound);
  }
  fs::remove(file);
  fs::create_directory(file);  // a folder of that name
  EXPECT_EQ(cache.make(wing_with_warnings(), &again).data.content_hash, hash);
  EXPECT_EQ(texts(again), texts(told));
}

TEST(ModeCache, IsDoneWithoutWhereNothingCanBeWritten) {
  const TemporaryFolder folder;
  write(folder / "file", "");
  for (const std::string& place : {folder / "file", folder / "file/below", std::string("/proc/cardan"), std::string(300, 'x')}) {
    const ModeCache cache(place);
    EXPECT_FALSE(cache.make(wing_with_warnings()).from_cache);
    EXPECT_FALSE(cache.make(wing_with_warnings()).from_cache);
  }
  EXPECT_FALSE(ModeCache().make(wing_with_warnings()).from_cache);
  EXPECT_EQ(content_of(folder / "file"), "");
}

TEST(ModeCache, IsBoundedAndThrowsAwayWhatWasNotUsedForLongest) {
  const auto beam = [](int decimetres) {  // files of one size
    ModalSource s;
    s.model = BeamModel{0.1 * decimetres, {7e10, 0.3, 2700.0}, tube_section(0.03, 0.002), 10, true};
    s.modes.count = 4;
    return s;
  };
  const TemporaryFolder folder;
  ModeCache(folder.path()).make(beam(10));
  const std::uintmax_t size = fs::file_size(only_file(folder.path()));
  const ModeCache cache(folder.path(), 5 * size + size / 2);
  const auto age = [&](int length, int minutes) {
    fs::last_write_time(folder.path() / fs::path(ModeCache::name_of(beam(length))),
                        fs::file_time_type::clock::now() - std::chrono::minutes(minutes));
  };
  for (int length = 11; length < 15; ++length) cache.make(beam(length));
  for (int length = 10; length < 15; ++length) age(length, 100 - length);
  write(folder / "abandoned.unfinished", "x");
  write(folder / "just begun.unfinished", "x");
  write(folder / "not ours.txt", "x");
  for (const char* name : {"abandoned.unfinished", "not ours.txt"})
    fs::last_write_time(folder / name, fs::file_time_type::clock::now() - std::chrono::hours(48));

  EXPECT_TRUE(cache.make(beam(10)).from_cache);  // the oldest, but used now
  EXPECT_FALSE(cache.make(beam(20)).from_cache);
  EXPECT_FALSE(cache.make(beam(21)).from_cache);
  std::uintmax_t total = 0;
  for (const auto& entry : fs::directory_iterator(folder.path()))
    if (entry.path().extension() == ".modes") total += entry.file_size();
  EXPECT_LE(total, 5 * size + size / 2);
  for (const int length : {10, 13, 14, 20, 21})
    EXPECT_TRUE(fs::exists(folder.path() / fs::path(ModeCache::name_of(beam(length))))) << length;
  for (const int length : {11, 12}) EXPECT_FALSE(fs::exists(folder.path() / fs::path(ModeCache::name_of(beam(length))))) << length;
  EXPECT_FALSE(fs::exists(folder / "abandoned.unfinished"));
  EXPECT_TRUE(fs::exists(folder / "just begun.unfinished"));
  EXPECT_TRUE(fs::exists(folder / "not ours.txt"));
}

TEST(ModeCache, IsSharedByManyAtOnce) {
  const TemporaryFolder folder;
  const std::string hash = make_modal_data(wing_with_warnings()).content_hash;
  std::vector<std::thread> users;
  for (int i = 0; i < 4; ++i)
    users.emplace_back([&] {
      for (int pass = 0; pass < 6; ++pass) {
        EXPECT_EQ(ModeCache(folder.path()).make(wing_with_warnings()).data.content_hash, hash);
        std::error_code gone;
        if (pass % 2 == 0) fs::remove(folder.path() / fs::path(ModeCache::name_of(wing_with_warnings())), gone);
      }
    });
  for (std::thread& user : users) user.join();
  EXPECT_TRUE(ModeCache(folder.path()).make(wing_with_warnings()).from_cache);
  only_file(folder.path());
}

TEST(ModeCache, OfTheUserIsWhereTheEnvironmentSays) {
  const auto folder = [](const char* wish, const char* cache, const char* home) {
    const auto set = [](const char* name, const char* value) { value ? setenv(name, value, 1) : unsetenv(name); };
    set("CARDAN_CACHE", wish), set("XDG_CACHE_HOME", cache), set("HOME", home);
    return ModeCache::of_user().folder().string();
  };
  EXPECT_EQ(folder(nullptr, nullptr, "/h"), "/h/.cache/cardan/modes");
  EXPECT_EQ(folder("", "", "/h"), "/h/.cache/cardan/modes");
  EXPECT_EQ(folder(nullptr, "/c", "/h"), "/c/cardan/modes");
  EXPECT_EQ(folder(nullptr, "relative", "/h"), "/h/.cache/cardan/modes");
  EXPECT_EQ(folder(nullptr, nullptr, nullptr), "");
  EXPECT_EQ(folder("off", "/c", "/h"), "");
  EXPECT_EQ(folder("/mine", "/c", "/h"), "/mine");
}

}  // namespace
}  // namespace cardan
