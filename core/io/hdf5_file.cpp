#include "core/io/hdf5_file.hpp"

#include <hdf5.h>
#include <sys/file.h>

#include <algorithm>
#include <filesystem>
#include <new>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>

#include "core/base/diagnostic.hpp"

namespace cardan {
namespace {

/// An open HDF5 object, closed at the end of the scope or, where a failure matters, by close().
class Handle {
 public:
  Handle(hid_t id, herr_t (*closer)(hid_t)) : id_(id), closer_(closer) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), closer_(other.closer_) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() { close(); }
  herr_t close() { return id_ >= 0 ? closer_(std::exchange(id_, H5I_INVALID_HID)) : 0; }
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*closer_)(hid_t);
};

void start_library() {
  H5dont_atexit();                              // files are closed by their owners; a broken one is left alone
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are ours to tell
}

/// Why the last call failed: the innermost message of HDF5's stack, or the operating system's where it is quoted there. Throws
/// std::bad_alloc where it was for want of memory.
std::string reason() {
  struct {
    std::string text;
    bool no_memory = false;
  } innermost;
  const auto keep_first = [](unsigned, const H5E_error2_t* e, void* out) -> herr_t {
    auto& first = *static_cast<decltype(innermost)*>(out);
    if (first.text.empty() && e->desc) first = {e->desc, e->maj_num == H5E_RESOURCE && e->min_num == H5E_NOSPACE};
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_first, &innermost);
  H5Eclear2(H5E_DEFAULT);
  if (innermost.no_memory) throw std::bad_alloc();
  std::string& text = innermost.text;
  const std::string quote = "error message = '";
  if (const auto start = text.find(quote); start != std::string::npos) {
    const auto from = start + quote.size();
    text = text.substr(from, text.find('\'', from) - from);
  }
  return text.empty() ? "unknown reason" : text;
}

const std::string kFlushed = "/flushed";

std::vector<hsize_t> dimensions(hid_t space) {
  if (H5Sget_simple_extent_type(space) == H5S_NULL) return {0};
  std::vector<hsize_t> dims(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space))));
  H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  return dims;
}

template <class Shape>
std::size_t product(const Shape& shape) {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, [](std::size_t a, auto b) { return a * static_cast<std::size_t>(b); });
}

void expect_size(std::size_t n, const std::vector<std::size_t>& shape, const std::string& path) {
  if (product(shape) != n) throw std::invalid_argument("Hdf5File::write " + path + ": shape and number of values differ");
}

Handle new_string_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

std::vector<const char*> pointers(std::span<const std::string> texts) {
  std::vector<const char*> out;
  for (const auto& text : texts) out.push_back(text.c_str());
  return out;
}

Handle new_space(const std::vector<std::size_t>& shape) {
  const std::vector<hsize_t> dims(shape.begin(), shape.end());
  return {dims.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose};
}

/// What is converted on its way goes through 64 kB at a time: by default HDF5 takes 2 MB, set to zero, for each text.
Handle new_transfer() {
  Handle transfer(H5Pcreate(H5P_DATASET_XFER), H5Pclose);
  H5Pset_buffer(transfer, 64 * 1024, nullptr, nullptr);
  return transfer;
}

}  // namespace

struct Hdf5File::Impl {
  std::string name;
  hid_t file = H5I_INVALID_HID;
  Handle transfer = new_transfer();  // of what is written

  Hdf5Rows flushed;  // as the file has it

  mutable bool broken = false;  // a write failed: HDF5 1.10 crashes when it is asked to finish such a file

  ~Impl() {
    if (file >= 0 && !broken) H5Fclose(file);
  }

  [[noreturn]] void cannot_read(const std::string& path, const std::string& expected, const std::string& got) const {
    refuse(Code::bad_result_file, {path, {name}}, expected, got);
  }
  [[noreturn]] void cannot_write(const std::string& path) const {
    broken = true;
    throw NumericsError(
        {.code = Code::disk_full, .what = name + ":" + path + ": " + reason(), .hint = "free space, or write to another disk"});
  }
  /// The results of writing calls pass through here.
  template <class Id>
  Id wrote(Id id, const std::string& path) const {
    if (id < 0) cannot_write(path);
    return id;
  }

  bool has(const std::string& path) const {
    for (auto end = path.find('/', 1);; end = path.find('/', end + 1)) {  // HDF5 asks for each part in turn
      const std::string part = path.substr(0, end);
      if (part != "/" && H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0) return false;
      if (end == std::string::npos) return true;
    }
  }
  /// A link that names another place, in this file or in another one, is not followed: it can lead round in a circle, or
  /// to what is no file.
  void expect_plain(const std::string& path) const {
    for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
      const std::string part = path.substr(0, end);
      H5L_info_t link{};
      if (part != "/" && (H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT) < 0 || link.type != H5L_TYPE_HARD))
        cannot_read(part, "a group or a dataset of this file", "a link to another place");
      if (end == std::string::npos) return;
    }
  }
  Handle dataset(const std::string& path) const {
    if (!has(path)) cannot_read(path, "a dataset", "nothing of this name");
    expect_plain(path);
    Handle set(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose);
    if (set < 0) cannot_read(path, "a dataset", reason());
    Handle properties(H5Dget_create_plist(set), H5Pclose);
    if (H5Pget_layout(properties) == H5D_VIRTUAL || H5Pget_external_count(properties) > 0)
      cannot_read(path, "a dataset of this file", "one whose numbers are in another file");
    return set;
  }
  Handle object(const std::string& path) const {
    if (!has(path)) cannot_read(path, "a group or a dataset", "nothing of this name");
    expect_plain(path);
    return {H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose};
  }

  /// Refuses many more values than what the file holds for them, `stored` bytes: a filter makes them at most 1032 times smaller
  /// (deflate), and what was never written takes none.
  void expect_bytes(const std::string& path, const std::vector<hsize_t>& dims, std::size_t size, hsize_t stored) const {
    constexpr double kUnwritten = 1 << 20, kPacking = 1032.0;
    const double bytes = std::accumulate(dims.begin(), dims.end(), static_cast<double>(size),
                                         [](double a, hsize_t b) { return a * static_cast<double>(b); });
    if (bytes > std::max(kUnwritten, kPacking * static_cast<double>(stored)))
      cannot_read(path, "as many values as the file has bytes for", "dimensions beyond that");
  }

  void make_group(const std::string& path) {
    if (path.empty() || path == "/" || has(path)) return;
    make_group(path.substr(0, path.rfind('/')));
    Handle ordered(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
    H5Pset_link_creation_order(ordered, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
    Handle group(wrote(H5Gcreate2(file, path.c_str(), H5P_DEFAULT, ordered, H5P_DEFAULT), path), H5Gclose);
  }

  /// A dataset at `path` in place of what was there.
  Handle new_dataset(const std::string& path, hid_t type, hid_t space, hid_t properties = H5P_DEFAULT) {
    make_group(path.substr(0, path.rfind('/')));
    if (has(path)) wrote(H5Ldelete(file, path.c_str(), H5P_DEFAULT), path);
    return {wrote(H5Dcreate2(file, path.c_str(), type, space, H5P_DEFAULT, properties, H5P_DEFAULT), path), H5Dclose};
  }
  /// All numbers or texts of a dataset. HDF5 keeps some of them in memory until it is closed.
  void fill(Handle set, const std::string& path, hid_t type, const void* data) const {
    wrote(H5Dwrite(set, type, H5S_ALL, H5S_ALL, transfer, data), path);
    wrote(set.close(), path);
  }
  void write(const std::string& path, hid_t type, const std::vector<std::size_t>& shape, const void* data) {
    const auto fits = [&](hid_t set) {
      Handle space(H5Dget_space(set), H5Sclose);
      Handle stored(H5Dget_type(set), H5Tclose);
      return std::ranges::equal(dimensions(space), shape) && H5Tequal(stored, type) > 0;
    };
    Handle old(has(path) && !is_group(path) ? H5Dopen2(file, path.c_str(), H5P_DEFAULT) : H5I_INVALID_HID, H5Dclose);
    if (old >= 0 && fits(old)) return fill(std::move(old), path, type, data);
    Handle space = new_space(shape);
    fill(new_dataset(path, type, space), path, type, data);
  }
  void make_rows(const std::string& path, hid_t type, std::size_t columns, std::size_t rows_per_block, std::size_t most_rows) {
    std::vector<hsize_t> now{0}, limit{most_rows > 0 ? most_rows : H5S_UNLIMITED}, block{rows_per_block};
    if (columns > 0) {
      for (auto* dims : {&now, &limit, &block}) dims->push_back(columns);
    }
    Handle space(H5Screate_simple(static_cast<int>(now.size()), now.data(), limit.data()), H5Sclose);
    Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(properties, static_cast<int>(block.size()), block.data());
    new_dataset(path, type, space, properties);
  }
  void append_rows(const std::string& path, hid_t type, std::size_t n, const void* values) const {
    Handle set = dataset(path);
    std::vector<hsize_t> size, start, count;
    {
      Handle space(H5Dget_space(set), H5Sclose);
      size = count = dimensions(space);
    }
    start.assign(size.size(), 0);
    start[0] = size[0];
    count[0] = n / (size.size() > 1 ? size[1] : 1);
    size[0] += count[0];
    wrote(H5Dset_extent(set, size.data()), path);
    Handle in_file(H5Dget_space(set), H5Sclose);
    H5Sselect_hyperslab(in_file, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    Handle in_memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
    wrote(H5Dwrite(set, type, in_memory, in_file, transfer, values), path);
    wrote(set.close(), path);  // the numbers go to disk here, what makes them visible in flush()
  }
  struct Whole {
    std::vector<std::size_t> shape;
    Handle in_memory, in_file;
  };
  /// A dataset without rows of a flush that has not ended.
  Whole whole_rows(hid_t set, const std::string& path) const {
    Handle space(H5Dget_space(set), H5Sclose);
    const auto dims = dimensions(space);
    expect_bytes(path, dims, H5Tget_size(Handle(H5Dget_type(set), H5Tclose)), H5Dget_storage_size(set));
    std::vector<std::size_t> shape(dims.begin(), dims.end());
    for (const auto& [beginning, rows] : flushed) {
      if (shape.empty() || shape[0] <= rows || !path.starts_with(beginning)) continue;
      shape[0] = rows;
      const std::vector<hsize_t> start(dims.size(), 0), count(shape.begin(), shape.end());
      if (rows == 0)
        H5Sselect_none(space);
      else
        H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    }
    Handle in_memory = new_space(shape);
    return {std::move(shape), std::move(in_memory), std::move(space)};
  }

  template <class T>
  Hdf5Array<T> read(const std::string& path, hid_t type) const {
    Handle set = dataset(path);
    Handle stored(H5Dget_type(set), H5Tclose);
    const H5T_class_t kind = H5Tget_class(stored);
    if (kind != H5T_FLOAT && kind != H5T_INTEGER) cannot_read(path, "numbers", "another type of data");
    const Whole whole = whole_rows(set, path);
    Hdf5Array<T> out{whole.shape, std::vector<T>(product(whole.shape))};
    if (!out.values.empty() && H5Dread(set, type, whole.in_memory, whole.in_file, H5P_DEFAULT, out.values.data()) < 0)
      cannot_read(path, "numbers", reason());
    return out;
  }

  /// Strings of a dataset or an attribute, of fixed or variable length, in the space that they take in memory; `get(type, buffer)` is
  /// H5Dread or H5Aread.
  template <class Get>
  std::vector<std::string> strings(const std::string& path, hid_t stored, hid_t space, Get get) const {
    if (H5Tget_class(stored) != H5T_STRING) cannot_read(path, "text", "another type of data");
    const std::size_t n = product(dimensions(space));
    std::vector<std::string> out;
    if (n == 0) return out;
    bool ok = true;
    if (H5Tis_variable_str(stored) > 0) {
      std::vector<char*> raw(n, nullptr);
      ok = get(stored, raw.data()) >= 0;
      for (const char* text : raw) out.emplace_back(text ? text : "");
      if (ok) H5Dvlen_reclaim(stored, space, H5P_DEFAULT, raw.data());
    } else {
      const std::size_t length = H5Tget_size(stored);
      std::string raw(n * length, '\0');
      ok = get(stored, raw.data()) >= 0;
      for (std::size_t i = 0; i < n; ++i) out.emplace_back(raw.substr(i * length, length).c_str());
    }
    if (!ok) cannot_read(path, "text", reason());
    return out;
  }
  std::vector<std::string> read_texts(const std::string& path) const {
    Handle set = dataset(path);
    Handle stored(H5Dget_type(set), H5Tclose);
    const Whole whole = whole_rows(set, path);
    return strings(path, stored, whole.in_memory,
                   [&](hid_t type, void* to) { return H5Dread(set, type, whole.in_memory, whole.in_file, H5P_DEFAULT, to); });
  }

  bool is_group(const std::string& path) const {
    expect_plain(path);
    return path == "/" || H5Iget_type(Handle(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose)) == H5I_GROUP;
  }

  void set_attribute(const std::string& path, const std::string& key, hid_t type, const std::vector<std::size_t>& shape, const void* data) {
    const std::string where = path + "@" + key;
    Handle owner = object(path);
    if (H5Aexists(owner, key.c_str()) > 0) wrote(H5Adelete(owner, key.c_str()), where);
    Handle space = new_space(shape);
    Handle attribute(wrote(H5Acreate2(owner, key.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), where), H5Aclose);
    if (product(shape) > 0) wrote(H5Awrite(attribute, type, data), where);
  }
  Handle attribute(const std::string& path, const std::string& key) const {
    Handle owner = object(path);
    if (H5Aexists(owner, key.c_str()) <= 0) cannot_read(path, "an attribute \"" + key + "\"", "none of this name");
    return {H5Aopen(owner, key.c_str(), H5P_DEFAULT), H5Aclose};
  }
  std::vector<std::string> text_attributes(const std::string& path, const std::string& key) const {
    Handle from = attribute(path, key);
    Handle stored(H5Aget_type(from), H5Tclose);
    Handle space(H5Aget_space(from), H5Sclose);
    const std::string where = path + "@" + key;
    expect_bytes(where, dimensions(space), H5Tget_size(stored), H5Aget_storage_size(from));
    return strings(where, stored, space, [&](hid_t type, void* to) { return H5Aread(from, type, to); });
  }
};

Hdf5File::Hdf5File(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Hdf5File::Hdf5File(Hdf5File&&) noexcept = default;
Hdf5File& Hdf5File::operator=(Hdf5File&&) noexcept = default;
Hdf5File::~Hdf5File() = default;

/// The file on disk stays as it was at the last flush until the next one: space once given is never given again, nor is some kept in
/// store that would be given back at the end (NONE), and structure is written by flush() alone (no evictions). Within a flush HDF5 writes
/// what tells of new rows before the rows' own places are known to be in the file; flush() says what can be read.
Hdf5File Hdf5File::create(const std::string& path) {
  start_library();
  Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_link_creation_order(creation, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  H5Pset_file_space_strategy(creation, H5F_FSPACE_STRATEGY_NONE, false, 1);
  Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_V18,
                       H5F_LIBVER_V110);  // a 1.10 file would stay marked as "open" after a kill
  H5AC_cache_config_t cache{};
  cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  H5Pget_mdc_config(access, &cache);
  cache.evictions_enabled = false;
  cache.incr_mode = H5C_incr__off;  // required by it
  cache.flash_incr_mode = H5C_flash_incr__off;
  cache.decr_mode = H5C_decr__off;
  H5Pset_mdc_config(access, &cache);
  H5Pset_file_locking(access, false, true);  // HDF5 would lock readers out
  auto impl = std::make_unique<Impl>();
  impl->name = path;
  impl->file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access);
  if (impl->file < 0)
    refuse(Code::cannot_write, {"", {path}}, "a file that can be written", reason(), "is the folder there, and may it be written to?");
  H5Fset_libver_bounds(impl->file, H5F_LIBVER_V110, H5F_LIBVER_V110);  // an index that grows without moving
  // A shared lock, as readers of HDF5 take it: they get in, and who asks for the exclusive one of a writer does not.
  if (void* descriptor = nullptr; H5Fget_vfd_handle(impl->file, H5P_DEFAULT, &descriptor) >= 0)
    flock(*static_cast<int*>(descriptor), LOCK_SH | LOCK_NB);
  return Hdf5File(std::move(impl));
}

Hdf5File Hdf5File::update(const std::string& path) {
  start_library();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return create(path);
  auto impl = std::make_unique<Impl>();
  impl->name = path;
  impl->file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  if (impl->file < 0) refuse(Code::cannot_write, {"", {path}}, "an HDF5 file that can be written", reason());
  return Hdf5File(std::move(impl));
}

Hdf5File Hdf5File::open(const std::string& path) {
  start_library();
  auto impl = std::make_unique<Impl>();
  impl->name = path;
  std::error_code none;
  if (const auto status = std::filesystem::status(path, none); std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    impl->cannot_read("", "an HDF5 file", "a folder, a pipe or a device");
  impl->file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (impl->file < 0) impl->cannot_read("", "an HDF5 file", reason());
  Hdf5File file(std::move(impl));
  if (file.has(kFlushed)) {
    const std::vector<std::int64_t> rows = file.read_integers(kFlushed).values;
    const std::vector<std::string> of = file.texts_attribute(kFlushed, "of");
    if (of.size() != rows.size() || std::ranges::any_of(rows, [](std::int64_t n) { return n < 0; }))
      file.impl_->cannot_read(kFlushed, "a number of rows for each name in \"of\"", "other numbers");
    for (std::size_t i = 0; i < of.size(); ++i) file.impl_->flushed.emplace_back(of[i], static_cast<std::size_t>(rows[i]));
  }
  return file;
}

const std::string& Hdf5File::file_name() const { return impl_->name; }

void Hdf5File::rename(const std::string& path) {
  std::error_code error;
  std::filesystem::rename(impl_->name, path, error);
  if (error) refuse(Code::cannot_write, {"", {path}}, "a file that can be replaced", error.message());
  impl_->name = path;
}

void Hdf5File::flush(const Hdf5Rows& rows) {
  if (!rows.empty() && !has(kFlushed)) {
    std::vector<std::string> of;
    for (const auto& [beginning, n] : rows) of.push_back(beginning);
    write(kFlushed, std::vector<std::int64_t>(rows.size(), 0));
    set_attribute(kFlushed, "of", of);
  }
  impl_->wrote(H5Fflush(impl_->file, H5F_SCOPE_LOCAL), "/");
  if (rows.empty()) return;
  std::vector<std::int64_t> numbers;
  for (const auto& [beginning, n] : rows) numbers.push_back(static_cast<std::int64_t>(n));
  write(kFlushed, numbers);
}

void Hdf5File::close() {
  if (impl_->file >= 0) impl_->wrote(H5Fclose(std::exchange(impl_->file, H5I_INVALID_HID)), "/");
}

bool Hdf5File::has(const std::string& path) const { return impl_->has(path); }
bool Hdf5File::is_group(const std::string& path) const { return impl_->has(path) && impl_->is_group(path); }

std::vector<std::string> Hdf5File::members(const std::string& group) const {
  if (!is_group(group)) impl_->cannot_read(group, "a group", "nothing of this name, or a dataset");
  Handle opened(H5Gopen2(impl_->file, group.c_str(), H5P_DEFAULT), H5Gclose);
  Handle properties(H5Gget_create_plist(opened), H5Pclose);
  unsigned order = 0;
  H5Pget_link_creation_order(properties, &order);
  const H5_index_t index = order & H5P_CRT_ORDER_INDEXED ? H5_INDEX_CRT_ORDER : H5_INDEX_NAME;
  std::vector<std::string> names;
  const auto keep = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  if (H5Literate(opened, index, H5_ITER_INC, nullptr, keep, &names) < 0) impl_->cannot_read(group, "a group", reason());
  return names;
}

std::vector<std::string> Hdf5File::datasets(const std::string& group) const {
  std::vector<std::string> paths;
  std::set<haddr_t> seen;
  const auto visit = [&](const std::string& path, const auto& self) -> void {
    H5O_info_t info{};
    if (!is_group(path) || H5Oget_info_by_name2(impl_->file, path.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT) < 0)
      impl_->cannot_read(path, "a group", "nothing of this name, or a dataset");
    if (!seen.insert(info.addr).second) impl_->cannot_read(path, "a group that is in the file once", "one that is linked again");
    for (const std::string& name : members(path)) {
      const std::string member = path == "/" ? path + name : path + "/" + name;
      if (is_group(member))
        self(member, self);
      else
        paths.push_back(member);
    }
  };
  visit(group, visit);
  return paths;
}

void Hdf5File::remove(const std::string& path) {
  if (has(path)) impl_->wrote(H5Ldelete(impl_->file, path.c_str(), H5P_DEFAULT), path);
}

void Hdf5File::make_group(const std::string& path) { impl_->make_group(path); }

void Hdf5File::write(const std::string& path, double value) { impl_->write(path, H5T_NATIVE_DOUBLE, {}, &value); }
void Hdf5File::write(const std::string& path, std::span<const double> values) {
  impl_->write(path, H5T_NATIVE_DOUBLE, {values.size()}, values.data());
}
void Hdf5File::write(const std::string& path, std::span<const double> values, const std::vector<std::size_t>& shape) {
  expect_size(values.size(), shape, path);
  impl_->write(path, H5T_NATIVE_DOUBLE, shape, values.data());
}
void Hdf5File::write_packed(const std::string& path, std::span<const double> values, const std::vector<std::size_t>& shape) {
  expect_size(values.size(), shape, path);
  if (values.empty()) return write(path, values, shape);  // a block holds something
  Handle space = new_space(shape);
  Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const std::vector<hsize_t> block(shape.begin(), shape.end());
  H5Pset_chunk(properties, static_cast<int>(block.size()), block.data());
  H5Pset_shuffle(properties);
  H5Pset_deflate(properties, 9);
  impl_->fill(impl_->new_dataset(path, H5T_NATIVE_DOUBLE, space, properties), path, H5T_NATIVE_DOUBLE, values.data());
}
void Hdf5File::write(const std::string& path, std::span<const std::int64_t> values) {
  impl_->write(path, H5T_NATIVE_INT64, {values.size()}, values.data());
}
void Hdf5File::write(const std::string& path, std::span<const std::int64_t> values, const std::vector<std::size_t>& shape) {
  expect_size(values.size(), shape, path);
  impl_->write(path, H5T_NATIVE_INT64, shape, values.data());
}
void Hdf5File::write(const std::string& path, const std::string& text) {
  const char* raw = text.c_str();
  impl_->write(path, new_string_type(), {}, &raw);
}
void Hdf5File::write(const std::string& path, const std::vector<std::string>& texts, const std::vector<std::size_t>& shape) {
  expect_size(texts.size(), shape, path);
  impl_->write(path, new_string_type(), shape, pointers(texts).data());
}

Hdf5Array<double> Hdf5File::read_doubles(const std::string& path) const { return impl_->read<double>(path, H5T_NATIVE_DOUBLE); }
Hdf5Array<std::int64_t> Hdf5File::read_integers(const std::string& path) const { return impl_->read<std::int64_t>(path, H5T_NATIVE_INT64); }
std::string Hdf5File::read_text(const std::string& path) const {
  const auto texts = impl_->read_texts(path);
  return texts.empty() ? std::string{} : texts.front();
}
std::vector<std::string> Hdf5File::read_texts(const std::string& path) const { return impl_->read_texts(path); }

std::vector<std::size_t> Hdf5File::shape(const std::string& path) const {
  Handle set = impl_->dataset(path);
  return impl_->whole_rows(set, path).shape;
}

void Hdf5File::make_rows(const std::string& path, std::size_t columns, std::size_t rows_per_block, std::size_t most_rows) {
  impl_->make_rows(path, H5T_NATIVE_DOUBLE, columns, rows_per_block, most_rows);
}
void Hdf5File::make_text_rows(const std::string& path, std::size_t columns, std::size_t rows_per_block) {
  impl_->make_rows(path, new_string_type(), columns, rows_per_block, 0);
}
void Hdf5File::append_rows(const std::string& path, std::span<const double> values) {
  impl_->append_rows(path, H5T_NATIVE_DOUBLE, values.size(), values.data());
}
void Hdf5File::append_rows(const std::string& path, const std::vector<std::string>& texts) {
  impl_->append_rows(path, new_string_type(), texts.size(), pointers(texts).data());
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, const std::string& text) {
  const char* raw = text.c_str();
  impl_->set_attribute(path, name, new_string_type(), {}, &raw);
}
void Hdf5File::set_attribute(const std::string& path, const std::string& name, const std::vector<std::string>& texts) {
  impl_->set_attribute(path, name, new_string_type(), {texts.size()}, pointers(texts).data());
}
void Hdf5File::set_attribute(const std::string& path, const std::string& name, double value) {
  impl_->set_attribute(path, name, H5T_NATIVE_DOUBLE, {}, &value);
}
void Hdf5File::set_attribute(const std::string& path, const std::string& name, std::int64_t value) {
  impl_->set_attribute(path, name, H5T_NATIVE_INT64, {}, &value);
}
void Hdf5File::set_attribute(const std::string& path, const std::string& name, std::span<const std::int64_t> values) {
  impl_->set_attribute(path, name, H5T_NATIVE_INT64, {values.size()}, values.data());
}

void Hdf5File::remove_attribute(const std::string& path, const std::string& name) {
  if (has_attribute(path, name)) impl_->wrote(H5Adelete(impl_->object(path), name.c_str()), path + "@" + name);
}
bool Hdf5File::has_attribute(const std::string& path, const std::string& name) const {
  return impl_->has(path) && H5Aexists(impl_->object(path), name.c_str()) > 0;
}
std::string Hdf5File::text_attribute(const std::string& path, const std::string& name) const {
  const auto texts = impl_->text_attributes(path, name);
  return texts.empty() ? std::string{} : texts.front();
}
std::vector<std::string> Hdf5File::texts_attribute(const std::string& path, const std::string& name) const {
  return impl_->text_attributes(path, name);
}

}  // namespace cardan
