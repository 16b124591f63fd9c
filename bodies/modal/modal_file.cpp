#include "bodies/modal/modal_file.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "bodies/modal/refuse.hpp"
#include "core/io/hdf5_file.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;

constexpr const char* kSchema = "cardan-modal/1";

/// The three things done with the one list of members below: write it, read it, hash it.
class Archive {
 public:
  virtual ~Archive() = default;
  virtual void numbers(const std::string& path, Hdf5Array<double>& array) = 0;
  virtual void text(const std::string& path, std::string& value) = 0;
};

class Writer : public Archive {
 public:
  explicit Writer(Hdf5File& file) : file_(file) {}
  void numbers(const std::string& path, Hdf5Array<double>& a) override { file_.write(path, a.values, a.shape); }
  void text(const std::string& path, std::string& value) override { file_.write(path, value); }

 private:
  Hdf5File& file_;
};

class Reader : public Archive {
 public:
  explicit Reader(const Hdf5File& file) : file_(file) {}
  void numbers(const std::string& path, Hdf5Array<double>& a) override {
    const std::size_t rank = a.shape.size();
    a = file_.read_doubles(path);
    if (a.shape.size() != rank)
      refuse({path, {file_.file_name(), 0, 0}}, {}, Code::bad_result_file, fmt::format("an array of rank {}", rank),
             fmt::format("rank {}", a.shape.size()));
  }
  void text(const std::string& path, std::string& value) override { value = file_.read_text(path); }

 private:
  const Hdf5File& file_;
};

class Hasher : public Archive {
 public:
  void numbers(const std::string& path, Hdf5Array<double>& a) override {
    add(path.data(), path.size());
    add(a.shape.data(), a.shape.size() * sizeof(std::size_t));
    add(a.values.data(), a.values.size() * sizeof(double));
  }
  void text(const std::string& path, std::string& value) override {
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

/// A fixed or dynamic matrix as a row-major array of rank 2, or a part of one of higher rank.
template <class Matrix>
void append(const Matrix& A, std::vector<double>& values) {
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    for (Eigen::Index j = 0; j < A.cols(); ++j) values.push_back(A(i, j));
}
template <class Matrix>
void take(const double* values, std::size_t rows, std::size_t cols, Matrix& A) {
  A.resize(rows, cols);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < cols; ++j) A(i, j) = values[i * cols + j];
}

template <int R, int C>
void io(Archive& archive, const std::string& path, Eigen::Matrix<double, R, C>& A) {
  Hdf5Array<double> a{{static_cast<std::size_t>(A.rows()), static_cast<std::size_t>(A.cols())}, {}};
  append(A, a.values);
  archive.numbers(path, a);
  const auto fits = [](std::size_t got, int fixed) {
    return fixed == Eigen::Dynamic || got == static_cast<std::size_t>(fixed);
  };
  if (!fits(a.shape[0], R) || !fits(a.shape[1], C))
    refuse({path, {}}, {}, Code::bad_result_file, fmt::format("{} x {}", R, C),
           fmt::format("{} x {}", a.shape[0], a.shape[1]));
  take(a.values.data(), a.shape[0], a.shape[1], A);
}

template <int R, int C>
void io(Archive& archive, const std::string& path, std::vector<Eigen::Matrix<double, R, C>>& list) {
  Hdf5Array<double> a{{list.size(), 0, 0}, {}};
  if (!list.empty())
    a.shape = {list.size(), static_cast<std::size_t>(list[0].rows()), static_cast<std::size_t>(list[0].cols())};
  for (const auto& A : list) append(A, a.values);
  archive.numbers(path, a);
  list.resize(a.shape[0]);
  for (std::size_t i = 0; i < list.size(); ++i)
    take(a.values.data() + i * a.shape[1] * a.shape[2], a.shape[1], a.shape[2], list[i]);
}

template <class Number>
void io_number(Archive& archive, const std::string& path, Number& value) {
  Hdf5Array<double> a{{}, {static_cast<double>(value)}};
  archive.numbers(path, a);
  value = static_cast<Number>(a.values.at(0));
}

template <class Item, class F>
void io_list(Archive& archive, const std::string& path, std::vector<Item>& list, F&& item) {
  std::size_t count = list.size();
  io_number(archive, path + "/count", count);
  list.resize(count);
  for (std::size_t i = 0; i < count; ++i) item(fmt::format("{}/{}", path, i), list[i]);
}

void io(Archive& a, ModalData& d) {
  io_number(a, "/n_modes", d.n_modes);
  a.text("/source", d.source);
  io(a, "/K", d.K);
  io(a, "/C", d.C);
  ModalIntegrals& I = d.integrals;
  io_number(a, "/integrals/I1", I.I1);
  io(a, "/integrals/I2", I.I2);
  io(a, "/integrals/I3", I.I3);
  io(a, "/integrals/I4", I.I4);
  io(a, "/integrals/I5", I.I5);
  io(a, "/integrals/I6", I.I6);
  io(a, "/integrals/I7", I.I7);
  io(a, "/integrals/I8", I.I8);
  io(a, "/integrals/I9", I.I9);
  io(a, "/integrals/rotary_ww", I.rotary_ww);
  io(a, "/integrals/rotary_we", I.rotary_we);
  io(a, "/integrals/rotary_ee", I.rotary_ee);
  io_list(a, "/nodes", d.nodes, [&](const std::string& path, ModalNode& n) {
    a.text(path + "/name", n.name);
    io(a, path + "/position", n.position);
    io(a, path + "/R_BN", n.R_BN);
    io(a, path + "/Phi", n.Phi);
    io(a, path + "/Psi", n.Psi);
  });
  io_list(a, "/mass_nodes", d.mass_nodes, [&](const std::string& path, MassNode& n) {
    io_number(a, path + "/mass", n.mass);
    io(a, path + "/position", n.position);
    io(a, path + "/inertia", n.inertia);
    io(a, path + "/Phi", n.Phi);
    io(a, path + "/Psi", n.Psi);
    io(a, path + "/Q", n.Q);
  });
  io_list(a, "/audit", d.audit, [&](const std::string& path, ModeRecord& r) {
    io_number(a, path + "/frequency", r.frequency);
    io(a, path + "/effective_mass", r.effective_mass);
    io_number(a, path + "/kept", r.kept);
    a.text(path + "/kind", r.kind);
    a.text(path + "/reason", r.reason);
  });
}

}  // namespace

std::string content_hash(const ModalData& data) {
  ModalData copy = data;
  Hasher hasher;
  io(hasher, copy);
  return hasher.digest();
}

void write_modal_file(const std::string& path, const ModalData& data) {
  ModalData copy = data;
  Hdf5File file = Hdf5File::create(path);
  file.set_attribute("/", "schema", std::string(kSchema));
  file.set_attribute("/", "content_hash", content_hash(data));
  file.set_attribute("/", "units", std::string("SI; body axes; modal coordinates scaled so that I6 is the modal mass"));
  Writer writer(file);
  io(writer, copy);
  file.close();
}

ModalData read_modal_file(const std::string& path) {
  const Hdf5File file = Hdf5File::open(path);
  const Located at = {"", {path, 0, 0}};
  const std::string schema = file.has_attribute("/", "schema") ? file.text_attribute("/", "schema") : "none";
  if (schema != kSchema)
    refuse(at, "schema", Code::bad_result_file, kSchema, schema, "write the file with this version of the program");
  ModalData data;
  Reader reader(file);
  io(reader, data);
  data.content_hash = content_hash(data);
  const std::string stored = file.text_attribute("/", "content_hash");
  if (stored != data.content_hash)
    refuse(at, "content_hash", Code::bad_result_file, stored, data.content_hash,
           "the file was changed after it was written");
  return data;
}

}  // namespace cardan
