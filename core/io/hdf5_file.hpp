#pragma once
// The one layer over HDF5: an open file with its groups, attributes and datasets, addressed by path ("/run/time").
// Arrays are row-major, as in the file (NumPy's order; Octave shows the dimensions reversed).
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace cardan {

/// Numbers of rows, by the beginning of the paths of those that have so many: {"/channels", 300}.
using Hdf5Rows = std::vector<std::pair<std::string, std::size_t>>;

template <class T>
struct Hdf5Array {
  std::vector<std::size_t> shape;  // empty = one number
  std::vector<T> values;           // row-major, as many as the product of `shape`
};

/// Reading throws InputError C0702 with the file, the path inside it and the reason; links to other places are not
/// followed, and dimensions that the file has no bytes for are refused. What is wrong in the structure of the file itself
/// can crash HDF5: a file that is not ours is read in a bounded child (bounded_child.hpp). Writing replaces what stands at
/// the path, makes missing groups, and throws NumericsError N0204 when the file does not take it (disk full).
class Hdf5File {
 public:
  /// A new file, in place of an old one. While it is open others may read it, and are refused when they want to write to it. Throws
  /// InputError C0701 with the reason.
  static Hdf5File create(const std::string& path);
  /// An existing file to write to, a new one if there is none. Throws InputError C0701.
  static Hdf5File update(const std::string& path);
  /// An existing file, to read. Throws InputError C0702.
  static Hdf5File open(const std::string& path);

  Hdf5File(Hdf5File&&) noexcept;
  Hdf5File& operator=(Hdf5File&&) noexcept;
  ~Hdf5File();  // closes; `close()` before it tells of errors

  const std::string& file_name() const;
  /// The open file takes this name in the same file system; whoever has open what stood there keeps it. Throws InputError C0701.
  void rename(const std::string& path);
  /// What was written so far survives the end of the process, however it ends. rows: of the datasets that grow, by the beginning of
  /// their paths, so many rows each are whole. The numbers are written to `/flushed` after all else, in one piece, and open() shows no rows
  /// beyond them: who reads while a flush is going on, or after a kill in its middle, sees what the flush before left.
  void flush(const Hdf5Rows& rows = {});
  void close();

  bool has(const std::string& path) const;
  /// Names of the members of a group, in the order of their creation.
  std::vector<std::string> members(const std::string& group) const;
  bool is_group(const std::string& path) const;
  /// Paths of all datasets below a group, in the order of their creation. A group that is linked twice is refused.
  std::vector<std::string> datasets(const std::string& group) const;

  void make_group(const std::string& path);
  void remove(const std::string& path);  // with its attributes, or all that is in a group; nothing if there is none
  void write(const std::string& path, double value);
  void write(const std::string& path, std::span<const double> values);  // 1-D
  void write(const std::string& path, std::span<const double> values, const std::vector<std::size_t>& shape);
  /// The same in one block, packed (bytes shuffled, deflate): for files that are finished when they are written.
  void write_packed(const std::string& path, std::span<const double> values, const std::vector<std::size_t>& shape);
  void write(const std::string& path, std::span<const std::int64_t> values);  // 1-D
  void write(const std::string& path, std::span<const std::int64_t> values, const std::vector<std::size_t>& shape);
  void write(const std::string& path, const std::string& text);  // UTF-8, of any length
  void write(const std::string& path, const std::vector<std::string>& texts, const std::vector<std::size_t>& shape);

  Hdf5Array<double> read_doubles(const std::string& path) const;  // any numeric dataset, converted
  Hdf5Array<std::int64_t> read_integers(const std::string& path) const;
  std::string read_text(const std::string& path) const;
  std::vector<std::string> read_texts(const std::string& path) const;  // row-major
  std::vector<std::size_t> shape(const std::string& path) const;

  /// A dataset that grows along its first dimension, in blocks of `rows_per_block`: `columns` numbers per row, or a 1-D
  /// dataset when `columns` is 0. Not compressed: a compressed block moves when it grows, and a process killed between
  /// two flushes then leaves a file that cannot be read. most_rows: no more will come (0: any number may); where one block holds them, the
  /// dataset needs no index of blocks, which takes 0.3 kB.
  void make_rows(const std::string& path, std::size_t columns, std::size_t rows_per_block, std::size_t most_rows = 0);
  /// The same of texts: rows of `columns` each.
  void make_text_rows(const std::string& path, std::size_t columns, std::size_t rows_per_block);
  /// Appends whole rows (row-major).
  void append_rows(const std::string& path, std::span<const double> values);
  void append_rows(const std::string& path, const std::vector<std::string>& texts);

  /// Attributes of a group or dataset ("/" is the file's root).
  void set_attribute(const std::string& path, const std::string& name, const std::string& text);
  void set_attribute(const std::string& path, const std::string& name, const std::vector<std::string>& texts);
  void set_attribute(const std::string& path, const std::string& name, double value);
  void set_attribute(const std::string& path, const std::string& name, std::int64_t value);
  void set_attribute(const std::string& path, const std::string& name, std::span<const std::int64_t> values);
  void remove_attribute(const std::string& path, const std::string& name);  // nothing if there is none
  bool has_attribute(const std::string& path, const std::string& name) const;
  std::string text_attribute(const std::string& path, const std::string& name) const;
  std::vector<std::string> texts_attribute(const std::string& path, const std::string& name) const;

 private:
  struct Impl;
  explicit Hdf5File(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace cardan
