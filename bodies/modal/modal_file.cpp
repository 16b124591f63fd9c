#include "bodies/modal/modal_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

#include "bodies/modal/lumped.hpp"
#include "bodies/modal/modal_check.hpp"
#include "bodies/modal/modal_source.hpp"
#include "bodies/modal/refuse.hpp"
#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/io/hdf5_file.hpp"

namespace cardan {
namespace {

constexpr const char* kSchema = "cardan-modal/1";
constexpr double kMostItems = 1e6, kMostDrawn = 5000;

using Shape = std::vector<std::size_t>;
using Array = Hdf5Array<double>;

std::string text_of(const Shape& shape) {
  std::string out;
  for (std::size_t n : shape) out += fmt::format("{}{}", out.empty() ? "" : " x ", n);
  return out.empty() ? "one number" : out;
}

[[noreturn]] void bad_file(const std::string& file, const std::string& path, const std::string& expected, std::string got) {
  refuse({path, {file}}, {}, Code::bad_result_file, fmt::format("{}: {}", path, expected), std::move(got));
}

/// The things done with the one list of members below: write it, read it, hash it, hand it from one process to another.
/// Where an array is read, `array.shape` is the shape it must have; `optional`: it may also be missing or without rows.
class Archive {
 public:
  virtual ~Archive() = default;
  virtual void numbers(const std::string& path, Array& array, bool optional) = 0;
  virtual void text(const std::string& path, std::string& value, bool optional) = 0;
  virtual bool reads() const { return false; }
  virtual bool hashes() const { return false; }
  /// Throws InputError C0702.
  [[noreturn]] virtual void refuse_value(const std::string& path, const std::string& expected, const std::string& got) const {
    bad_file("", path, expected, got);
  }
};

class Writer : public Archive {
 public:
  explicit Writer(Hdf5File& file) : file_(file) {}
  void numbers(const std::string& path, Array& a, bool) override { file_.write(path, a.values, a.shape); }
  void text(const std::string& path, std::string& value, bool) override { file_.write(path, value); }

 private:
  Hdf5File& file_;
};

/// What both readers know: nothing is read that has not the shape it must have.
class AnyReader : public Archive {
 public:
  explicit AnyReader(std::string file) : name_(std::move(file)) {}
  bool reads() const override { return true; }
  [[noreturn]] void refuse_value(const std::string& path, const std::string& expected, const std::string& got) const override {
    bad_file(name_, path, expected, got);
  }

 protected:
  /// Whether there are rows to read. A number may be written as an array of one and the other way round, a column as an array of rank 1.
  bool has_rows(const std::string& path, const Shape& expected, const Shape& got, bool optional) const {
    if (optional && !got.empty() && got[0] == 0) return false;
    Shape column = got;
    column.push_back(1);
    const bool one = got.empty() && std::ranges::all_of(expected, [](std::size_t n) { return n == 1; });
    if (got != expected && !one && !(expected.empty() && got == Shape{1}) && column != expected)
      refuse_value(path, text_of(expected), text_of(got));
    return true;
  }

 private:
  std::string name_;
};

class Reader : public AnyReader {
 public:
  explicit Reader(const Hdf5File& file) : AnyReader(file.file_name()), file_(file) {}
  void numbers(const std::string& path, Array& a, bool optional) override {
    asked_.push_back(path);
    const Shape expected = a.shape;
    if ((optional && !file_.has(path)) || !has_rows(path, expected, file_.shape(path), optional))
      a = {Shape(expected.size(), 0), {}};
    else
      a = {expected, file_.read_doubles(path).values};
  }
  void text(const std::string& path, std::string& value, bool optional) override {
    asked_.push_back(path);
    value = optional && !file_.has(path) ? "" : file_.read_text(path);
  }
  /// Once all is read: what is not a part of a modal file, a word that is spelled differently or an item beyond `count`, is refused.
  void expect_nothing_else() const {
    const std::set<std::string> known(asked_.begin(), asked_.end());
    for (const std::string& path : file_.datasets("/")) {
      if (known.contains(path)) continue;
      const std::string meant = did_you_mean(path, asked_);
      refuse({path, {file_.file_name()}}, {}, Code::bad_result_file, "a part of a modal file", in_quotes(printable(path)),
             meant.empty() ? "remarks may stand in attributes; docs/modal_files.md has all parts" : meant);
    }
  }

 private:
  const Hdf5File& file_;
  std::vector<std::string> asked_;
};

class Hasher : public Archive {
 public:
  bool hashes() const override { return true; }
  void numbers(const std::string& path, Array& a, bool) override {
    add(path.data(), path.size());
    add(a.shape.data(), a.shape.size() * sizeof(std::size_t));
    add(a.values.data(), a.values.size() * sizeof(double));
  }
  void text(const std::string& path, std::string& value, bool) override {
    add(path.data(), path.size());
    add(value.data(), value.size());
  }
  std::string digest() const { return fmt::format("{:016x}", hash_); }

 private:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 0x100000001b3u;
    hash_ = (hash_ ^ size) * 0x100000001b3u;
  }
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

/// From the child that has read the file ...
class Sender : public Archive {
 public:
  explicit Sender(ByteWriter& bytes) : bytes_(bytes) {}
  void numbers(const std::string&, Array& a, bool) override {
    bytes_.number(a.shape.size());
    for (std::size_t n : a.shape) bytes_.number(n);
    bytes_.number(a.values.size());
    bytes_.raw(a.values.data(), a.values.size() * sizeof(double));
  }
  void text(const std::string&, std::string& value, bool) override { bytes_.text(value); }

 private:
  ByteWriter& bytes_;
};

/// ... to this process, which trusts the child no more than the file.
class Receiver : public AnyReader {
 public:
  Receiver(ByteReader& bytes, const std::string& file) : AnyReader(file), bytes_(bytes) {}
  void numbers(const std::string& path, Array& a, bool optional) override {
    const Shape expected = a.shape;
    Shape got(std::min(bytes_.number(), std::size_t{8}));
    for (std::size_t& n : got) n = bytes_.number();
    const std::size_t count = bytes_.number();
    if (!has_rows(path, expected, got, optional)) {
      a = {Shape(expected.size(), 0), {}};
      return;
    }
    std::size_t product = 1;
    for (std::size_t n : expected) product *= n;
    if (count != product || count > bytes_.left() / sizeof(double)) throw std::out_of_range("Receiver");
    a = {expected, std::vector<double>(count)};
    bytes_.raw(a.values.data(), count * sizeof(double));
  }
  void text(const std::string&, std::string& value, bool) override { value = bytes_.text(); }

 private:
  ByteReader& bytes_;
};

/// A matrix as a row-major array of rank 2, or a part of one of higher rank.
template <class Matrix>
void append(const Matrix& A, std::vector<double>& values) {
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    for (Eigen::Index j = 0; j < A.cols(); ++j) values.push_back(A(i, j));
}
template <class Matrix>
void take(const double* values, std::size_t rows, std::size_t cols, Matrix& A) {
  A.resize(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < cols; ++j) A(i, j) = values[i * cols + j];
}

/// A rows x cols matrix. Shapes that are not there are 0 x 0 (`optional`).
template <int R, int C>
void io(Archive& archive, const std::string& path, Eigen::Matrix<double, R, C>& A, std::size_t rows, std::size_t cols,
        bool optional = false) {
  Array a{{static_cast<std::size_t>(A.rows()), static_cast<std::size_t>(A.cols())}, {}};
  if (archive.reads())
    a.shape = {rows, cols};
  else
    append(A, a.values);
  archive.numbers(path, a, optional);
  if (archive.reads()) take(a.values.data(), a.shape[0], cols, A);
}

/// `count` matrices of rows x cols.
template <int R, int C>
void io(Archive& archive, const std::string& path, std::vector<Eigen::Matrix<double, R, C>>& list, std::size_t count, std::size_t rows,
        std::size_t cols, bool optional = false) {
  Array a{{list.size(), 0, 0}, {}};
  if (!list.empty()) a.shape = {list.size(), static_cast<std::size_t>(list[0].rows()), static_cast<std::size_t>(list[0].cols())};
  if (archive.reads()) a.shape = {count, rows, cols};
  for (const auto& A : list) append(A, a.values);
  archive.numbers(path, a, optional);
  if (!archive.reads()) return;
  list.resize(a.shape[0]);
  for (std::size_t i = 0; i < list.size(); ++i) take(a.values.data() + i * rows * cols, rows, cols, list[i]);
}

void io_number(Archive& archive, const std::string& path, double& value) {
  Array a{{}, {value}};
  archive.numbers(path, a, false);
  value = a.values.at(0);
}

template <class Whole>
void io_whole(Archive& archive, const std::string& path, Whole& value, double least, double most) {
  double number = static_cast<double>(value);
  io_number(archive, path, number);
  if (!(number >= least && number <= most && number == std::floor(number)))
    archive.refuse_value(path, fmt::format("a whole number, {} ... {}", least, most), fmt::format("{}", number));
  value = static_cast<Whole>(number);
}

/// Groups 0, 1, ... below `path`, each one written or read by `item`.
template <class Item, class F>
void io_list(Archive& archive, const std::string& path, std::vector<Item>& list, F&& item) {
  std::size_t count = list.size();
  io_whole(archive, path + "/count", count, 0, kMostItems);
  for (std::size_t i = 0; i < count; ++i) {
    if (archive.reads()) list.emplace_back();
    item(fmt::format("{}/{}", path, i), list[i]);
  }
}

/// What a file may leave out.
struct Parts {
  bool integrals = true, nodes = true, mass_nodes = true, audit = true, drawing = true;
};
/// Of data at hand: a drawing that is empty is not there.
Parts parts_of(const ModalData& d) {
  Parts parts;
  parts.drawing = d.drawing.points.rows() > 0;
  return parts;
}

void io(Archive& a, ModalData& d, const Parts& parts) {
  io_whole(a, "/n_modes", d.n_modes, 1, kMostModesOfBody);
  const auto m = static_cast<std::size_t>(d.n_modes);
  a.text("/source", d.source, true);
  io(a, "/K", d.K, m, m);
  io(a, "/C", d.C, m, m, true);
  if (d.C.size() == 0) d.C.setZero(d.n_modes, d.n_modes);
  if (parts.integrals) {
    ModalIntegrals& I = d.integrals;
    const auto vector = [&](const char* path, Eigen::Vector3d& v) { io(a, path, v, 3, 1); };
    io_number(a, "/integrals/I1", I.I1);
    vector("/integrals/I2", I.I2);
    io(a, "/integrals/I3", I.I3, 3, m);
    io(a, "/integrals/I4", I.I4, 3, m);
    std::vector<Eigen::MatrixXd> I5 = I.of_change ? I.I5 : std::vector<Eigen::MatrixXd>();  // this and I8 may be missing together
    io(a, "/integrals/I5", I5, m, 3, m, true);
    io(a, "/integrals/I6", I.I6, m, m);
    io(a, "/integrals/I7", I.I7, 3, 3);
    std::vector<Eigen::Matrix3d> I8 = I.of_change ? I.I8 : std::vector<Eigen::Matrix3d>();
    io(a, "/integrals/I8", I8, m, 3, 3, true);
    if (I5.size() != I8.size()) a.refuse_value("/integrals", "I5 and I8, or none of them", "one of them");
    if (a.reads()) {
      I.of_change = !I5.empty();
      I5.resize(m, Eigen::MatrixXd::Zero(3, d.n_modes)), I8.resize(m, Eigen::Matrix3d::Zero());
      I.I5 = std::move(I5), I.I8 = std::move(I8);
    }
    io(a, "/integrals/I9", I.I9, m * m, 3, 3, true);
    io(a, "/integrals/rotary_ww", I.rotary_ww, m, 3, 3, true);
    io(a, "/integrals/rotary_we", I.rotary_we, m, 3, m, true);
    io(a, "/integrals/rotary_ee", I.rotary_ee, m, m, m, true);
    if (!a.hashes() || I.rotary_turn.size() > 0) {  // younger than the hashes of files without them
      Eigen::VectorXd share = Eigen::VectorXd::Constant(I.rotary_turn.size() > 0 ? 1 : 0, I.rotary_share);
      io(a, "/integrals/rotary_turn", I.rotary_turn, m, 1, true);
      io(a, "/integrals/rotary_share", share, 1, 1, true);
      if ((share.size() > 0) != (I.rotary_turn.size() > 0))
        a.refuse_value("/integrals", "rotary_turn and rotary_share, or none of them", "one of them");
      if (share.size() > 0) I.rotary_share = share[0];
    }
    if (I.rotary_we.size() != I.rotary_ww.size() || I.rotary_ee.size() != I.rotary_ww.size())
      a.refuse_value("/integrals", "rotary_ww, rotary_we and rotary_ee, or none of them", "some of them");
  }
  if (parts.nodes)
    io_list(a, "/nodes", d.nodes, [&](const std::string& path, ModalNode& n) {
      a.text(path + "/name", n.name, false);
      io(a, path + "/position", n.position, 3, 1);
      io(a, path + "/R_BN", n.R_BN, 3, 3);
      io(a, path + "/Phi", n.Phi, 3, m, true);
      io(a, path + "/Psi", n.Psi, 3, m, true);
    });
  if (parts.mass_nodes)
    io_list(a, "/mass_nodes", d.mass_nodes, [&](const std::string& path, MassNode& n) {
      io_number(a, path + "/mass", n.mass);
      io(a, path + "/position", n.position, 3, 1);
      io(a, path + "/inertia", n.inertia, 3, 3);
      io(a, path + "/Phi", n.Phi, 3, m, true);
      io(a, path + "/Psi", n.Psi, 3, m, true);
      io(a, path + "/Q", n.Q, 3, m, m, true);
    });
  if (parts.audit)
    io_list(a, "/audit", d.audit, [&](const std::string& path, ModeRecord& r) {
      io_number(a, path + "/frequency", r.frequency);
      io(a, path + "/effective_mass", r.effective_mass, 6, 1);
      io_whole(a, path + "/kept", r.kept, 0, 1);
      a.text(path + "/kind", r.kind, true);
      a.text(path + "/reason", r.reason, true);
    });
  if (parts.drawing) {
    auto n = static_cast<std::size_t>(d.drawing.points.rows()), k = static_cast<std::size_t>(d.drawing.lines.rows());
    std::size_t pictured = d.drawing.shapes.size();
    io_whole(a, "/drawing/count", n, 0, kMostDrawn);
    io_whole(a, "/drawing/line_count", k, 0, kMostDrawn);
    io_whole(a, "/drawing/mode_count", pictured, 0, static_cast<double>(m));
    io(a, "/drawing/points", d.drawing.points, n, 3, true);
    io(a, "/drawing/lines", d.drawing.lines, k, 2, true);
    io(a, "/drawing/shapes", d.drawing.shapes, pictured, n, 3, true);
  }
}

/// The content of an open file with the right shapes, and the hash written beside it (empty: none).
std::string read(const Hdf5File& file, ModalData& data) {
  const std::string& name = file.file_name();
  const bool has_schema = file.has_attribute("/", "schema");
  const std::string schema = has_schema ? file.text_attribute("/", "schema") : "";
  if (schema != kSchema)
    refuse({"", {name}}, "schema", Code::bad_result_file, fmt::format("a modal file: the attribute schema of / is {}", in_quotes(kSchema)),
           has_schema ? in_quotes(schema) : "no such attribute", "`cardan modes` writes one; its layout is in docs/modal_files.md");
  Reader reader(file);
  const Parts parts{file.has("/integrals"), file.has("/nodes"), file.has("/mass_nodes"), file.has("/audit"), file.has("/drawing")};
  if (!parts.integrals && !parts.mass_nodes) bad_file(name, "/integrals", "integrals, or mass nodes to compute them from", "neither");
  io(reader, data, parts);
  reader.expect_nothing_else();
  if (!parts.integrals) {
    ModalData lumped = lumped_modal_data(std::move(data.mass_nodes), std::move(data.K), std::move(data.C), std::move(data.nodes));
    if (!data.source.empty()) lumped.source = std::move(data.source);
    lumped.audit = std::move(data.audit);
    lumped.drawing = std::move(data.drawing);
    data = std::move(lumped);
  }
  return file.has_attribute("/", "content_hash") ? file.text_attribute("/", "content_hash") : "";
}

/// What lumped masses are checked for, and what their sums cannot but obey.
void check(ModalData& data, const std::string& stored_hash, const std::string& file) {
  const Located at = {"", {file, 0, 0}};
  const auto m = Eigen::Index{data.n_modes};
  check_stiffness(data.K, data.C, at);
  check_nodes(data.nodes, m, at);
  for (std::size_t j = 0; j < data.mass_nodes.size(); ++j) check_mass_node(data.mass_nodes[j], m, j, at);
  check_integrals(data, at);
  for (const ModeRecord& r : data.audit)
    if (!std::isfinite(r.frequency) || !r.effective_mass.allFinite())
      bad_file(file, "/audit", "finite frequencies and effective masses", "a value that is not finite");
  const ModalDrawing& d = data.drawing;
  const bool drawn = d.shapes.empty() || d.shapes[0].rows() == d.points.rows();
  const bool finite = std::all_of(d.shapes.begin(), d.shapes.end(), [](const Eigen::MatrixXd& s) { return s.allFinite(); });
  if (!drawn || !finite || !d.points.allFinite() || !(d.lines.array() >= 0.0).all() ||
      !(d.lines.array() < static_cast<double>(d.points.rows())).all() || d.lines != d.lines.array().floor().matrix())
    bad_file(file, "/drawing", "finite points and shapes, and lines between points that are there", "others");
  data.source = printable(data.source);
  data.content_hash = content_hash(data);
  if (!stored_hash.empty() && stored_hash != data.content_hash)
    refuse(at, "content_hash", Code::bad_result_file, data.content_hash, in_quotes(printable(stored_hash)),
           "the file was changed after it was written: take the attribute away if that was meant");
}

}  // namespace

std::string content_hash(const ModalData& data) {
  ModalData copy = data;
  Hasher hasher;
  io(hasher, copy, parts_of(data));
  return hasher.digest();
}

void write_modal_file(const std::string& path, const ModalData& data) {
  ModalData copy = data;
  Hdf5File file = Hdf5File::create(path);
  file.set_attribute("/", "schema", std::string(kSchema));
  file.set_attribute("/", "content_hash", content_hash(data));
  file.set_attribute("/", "units", std::string("SI; body axes; modal coordinates scaled so that I6 is the modal mass"));
  Writer writer(file);
  io(writer, copy, parts_of(data));
  file.close();
}

ModalData modal_data_of(const Hdf5File& file) {
  ModalData data;
  const std::string hash = read(file, data);
  check(data, hash, file.file_name());
  return data;
}

ModalData read_modal_file(const std::string& path, const ChildLimits& limits) {
  const std::string answer = in_bounded_child(
      path,
      [&path] {
        ModalData data;
        const std::string hash = read(Hdf5File::open(path), data);
        ByteWriter bytes;
        bytes.text(hash);
        Sender sender(bytes);
        io(sender, data, {});
        return bytes.take();
      },
      limits);
  ModalData data;
  std::string hash;
  try {
    ByteReader bytes(answer);
    hash = bytes.text();
    Receiver receiver(bytes, path);
    io(receiver, data, {});
  } catch (const std::out_of_range&) {
    bad_file(path, "/", "modal data", "half of them");
  }
  check(data, hash, path);
  return data;
}

std::string modal_bytes(const ModalData& data) {
  ModalData copy = data;
  ByteWriter bytes;
  Sender sender(bytes);
  io(sender, copy, {});
  return bytes.take();
}

ModalData modal_data_of_bytes(const std::string& content) {
  ModalData data;
  ByteReader bytes(content);
  Receiver receiver(bytes, "");
  io(receiver, data, {});
  return data;
}

ModalData read_modal_file(const std::string& path) { return read_modal_file(path, limits_for_file(path)); }

}  // namespace cardan
