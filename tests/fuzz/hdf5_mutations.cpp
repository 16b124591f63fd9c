#include "tests/fuzz/hdf5_mutations.hpp"

#include <hdf5.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace cardan::fuzz {
namespace {

/// Everything in a file: paths of groups and datasets, and attributes as owner and name.
struct Content {
  std::vector<std::string> groups{"/"}, datasets;
  std::vector<std::pair<std::string, std::string>> attributes;
};

Content content_of(hid_t file) {
  Content out;
  const auto visit = [](hid_t root, const char* name, const H5O_info_t* info, void* to) -> herr_t {
    auto& all = *static_cast<Content*>(to);
    const std::string path = std::strcmp(name, ".") == 0 ? "/" : std::string("/") + name;
    if (path != "/") (info->type == H5O_TYPE_GROUP ? all.groups : all.datasets).push_back(path);
    const hid_t object = H5Oopen(root, path.c_str(), H5P_DEFAULT);
    for (hsize_t i = 0; i < info->num_attrs; ++i) {
      char attribute[256] = "";
      if (H5Aget_name_by_idx(object, ".", H5_INDEX_NAME, H5_ITER_INC, i, attribute, sizeof attribute, H5P_DEFAULT) >= 0)
        all.attributes.emplace_back(path, attribute);
    }
    H5Oclose(object);
    return 0;
  };
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, visit, &out, H5O_INFO_BASIC | H5O_INFO_NUM_ATTRS);
  return out;
}

const double kOdd[] = {0.0,      -0.0,      -1.0,         1e308, -1e308, 5e-324, 1e18, 1e9, 0.5, std::numeric_limits<double>::quiet_NaN(),
                       HUGE_VAL, -HUGE_VAL, 2147483648.0, 3.0,   1e-310};

std::vector<hsize_t> odd_shape(const std::vector<hsize_t>& shape, Random& random) {
  std::vector<hsize_t> out = shape;
  switch (random.below(6)) {
    case 0:
      out.push_back(1 + random.below(3));
      break;
    case 1:
      if (!out.empty()) out.pop_back();
      break;
    case 2:
      out = {0};
      break;
    case 3:
      out.clear();
      break;
    default:
      if (!out.empty()) {
        hsize_t& n = out[random.below(out.size())];
        n = random.one_in(2) ? n + 1 : random.below(12);
      }
  }
  return out;
}

hid_t odd_type(Random& random) {
  switch (random.below(7)) {
    case 0:
      return H5Tcopy(H5T_NATIVE_INT32);
    case 1:
      return H5Tcopy(H5T_IEEE_F32BE);
    case 2:
      return H5Tcopy(H5T_NATIVE_UINT8);
    case 3: {
      const hid_t t = H5Tcopy(H5T_C_S1);
      H5Tset_size(t, 1 + random.below(40));
      return t;
    }
    case 4: {
      const hid_t t = H5Tcopy(H5T_C_S1);
      H5Tset_size(t, H5T_VARIABLE);
      return t;
    }
    case 5: {
      const hid_t t = H5Tcreate(H5T_COMPOUND, 16);
      H5Tinsert(t, "a", 0, H5T_NATIVE_DOUBLE);
      H5Tinsert(t, "b", 8, H5T_NATIVE_INT64);
      return t;
    }
    default:
      return H5Tcopy(H5T_STD_REF_OBJ);
  }
}

std::vector<hsize_t> shape_of(hid_t space) {
  std::vector<hsize_t> shape(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space))));
  H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}
hid_t space_of(const std::vector<hsize_t>& shape) {
  return shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
}

/// A new dataset in place of another one; attributes are taken over where they can be.
void replace(hid_t file, const std::string& path, hid_t type, const std::vector<hsize_t>& shape, bool null, Random& random) {
  const hid_t old = H5Dopen2(file, path.c_str(), H5P_DEFAULT);
  const hid_t space = null ? H5Screate(H5S_NULL) : space_of(shape);
  const std::string fresh = path + "_new";
  const hid_t set = H5Dcreate2(file, fresh.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  if (set >= 0) {
    const auto n = static_cast<std::size_t>(std::max<hssize_t>(0, H5Sget_simple_extent_npoints(space)));
    if (n > 0 && n < 100'000 && H5Tget_class(type) == H5T_FLOAT && H5Tget_size(type) == 8) {
      std::vector<double> values(n);
      for (double& v : values) v = random.one_in(4) ? random.of(kOdd) : 1.0;
      H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    }
    const auto copy = [](hid_t from, const char* name, const H5A_info_t*, void* to) -> herr_t {
      const hid_t a = H5Aopen(from, name, H5P_DEFAULT), t = H5Aget_type(a), s = H5Aget_space(a);
      std::vector<char> bytes(static_cast<std::size_t>(H5Aget_storage_size(a)) + 64);
      if (H5Aread(a, t, bytes.data()) >= 0) {
        const hid_t b = H5Acreate2(*static_cast<hid_t*>(to), name, t, s, H5P_DEFAULT, H5P_DEFAULT);
        H5Awrite(b, t, bytes.data());
        H5Aclose(b);
        if (H5Tis_variable_str(t) > 0) H5Dvlen_reclaim(t, s, H5P_DEFAULT, bytes.data());
      }
      H5Sclose(s), H5Tclose(t), H5Aclose(a);
      return 0;
    };
    hid_t to = set;
    hsize_t index = 0;
    H5Aiterate2(old, H5_INDEX_NAME, H5_ITER_INC, &index, copy, &to);
    H5Dclose(set);
    H5Dclose(old);
    H5Ldelete(file, path.c_str(), H5P_DEFAULT);
    H5Lmove(file, fresh.c_str(), H5L_SAME_LOC, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  } else {
    H5Dclose(old);
  }
  H5Sclose(space);
}

void change_dataset(hid_t file, const std::string& path, Random& random) {
  const hid_t set = H5Dopen2(file, path.c_str(), H5P_DEFAULT);
  if (set < 0) return;
  const hid_t type = H5Dget_type(set), space = H5Dget_space(set);
  const std::vector<hsize_t> shape = shape_of(space);
  const auto n = static_cast<std::size_t>(std::max<hssize_t>(0, H5Sget_simple_extent_npoints(space)));
  const bool numbers = H5Tget_class(type) == H5T_FLOAT;
  switch (random.below(8)) {
    case 0:
    case 1:
    case 2:
      if (numbers && n > 0 && n < 100'000) {  // odd numbers in it
        std::vector<double> values(n);
        H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
        for (std::size_t k = 1 + random.below(3); k > 0; --k) {
          double& v = values[random.below(n)];
          v = random.one_in(3) ? -v : random.one_in(2) ? random.of(kOdd) : v * 1.5;
        }
        H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
      }
      H5Dclose(set);
      break;
    case 3:
    case 4:
      H5Dclose(set);
      replace(file, path, type, odd_shape(shape, random), random.one_in(6), random);
      break;
    case 5: {
      H5Dclose(set);
      const hid_t odd = odd_type(random);
      replace(file, path, odd, shape, false, random);
      H5Tclose(odd);
      break;
    }
    case 6: {  // as many rows as can be written down
      std::vector<hsize_t> more = shape;
      for (hsize_t& k : more) k = random.one_in(2) ? hsize_t{1} << (20 + random.below(40)) : k + 1 + random.below(50);
      H5Dset_extent(set, more.data());  // where it may grow
      H5Dclose(set);
      break;
    }
    default:
      H5Dclose(set);
      H5Ldelete(file, path.c_str(), H5P_DEFAULT);
      if (random.one_in(2)) {  // a group in its place
        const hid_t group = H5Gcreate2(file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        H5Gclose(group);
      }
  }
  H5Sclose(space);
  H5Tclose(type);
}

void change_attribute(hid_t file, const std::pair<std::string, std::string>& attribute, Random& random) {
  const hid_t owner = H5Oopen(file, attribute.first.c_str(), H5P_DEFAULT);
  if (owner < 0) return;
  H5Adelete(owner, attribute.second.c_str());
  if (!random.one_in(3)) {
    const hid_t type = random.one_in(2) ? odd_type(random) : H5Tcopy(H5T_NATIVE_DOUBLE);
    const hid_t space = random.one_in(5) ? H5Screate(H5S_NULL)
                                         : space_of(random.one_in(2) ? std::vector<hsize_t>{} : std::vector<hsize_t>{1 + random.below(9)});
    const hid_t a = H5Acreate2(owner, attribute.second.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
    if (a >= 0) {
      const std::vector<char> zeros(static_cast<std::size_t>(H5Aget_storage_size(a)) + 64, 0);
      H5Awrite(a, type, zeros.data());
      H5Aclose(a);
    }
    H5Sclose(space);
    H5Tclose(type);
  }
  H5Oclose(owner);
}

void change_links(hid_t file, const Content& content, Random& random) {
  const std::string from = random.of(content.groups), name = (from == "/" ? from : from + "/") + (random.one_in(2) ? "extra" : "0");
  const std::string any = random.one_in(2) || content.datasets.empty() ? random.of(content.groups) : random.of(content.datasets);
  H5Ldelete(file, name.c_str(), H5P_DEFAULT);
  switch (random.below(4)) {
    case 0:
      H5Lcreate_soft(any.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      break;
    case 1:
      H5Lcreate_external("/dev/zero", any.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      break;
    default:
      H5Lcreate_hard(file, any.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  }
}

hid_t open_to_change(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  return H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
}

}  // namespace

void mutate_hdf5(const std::string& path, Random& random) {
  const hid_t file = open_to_change(path);
  for (std::size_t n = 1 + random.below(4); n > 0; --n) {
    const Content content = content_of(file);
    const std::size_t what = random.below(10);
    if (what < 7 && !content.datasets.empty())
      change_dataset(file, random.of(content.datasets), random);
    else if (what < 8 && !content.attributes.empty())
      change_attribute(file, random.of(content.attributes), random);
    else if (what < 9)
      change_links(file, content, random);
    else if (content.groups.size() > 1)
      H5Ldelete(file, content.groups[1 + random.below(content.groups.size() - 1)].c_str(), H5P_DEFAULT);
  }
  H5Fclose(file);
}

void link_group_into_itself(const std::string& path, const std::string& group) {
  const hid_t file = open_to_change(path);
  H5Lcreate_hard(file, group.c_str(), file, (group + "/again").c_str(), H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(file);
}
void link_softly(const std::string& path, const std::string& from, const std::string& to) {
  const hid_t file = open_to_change(path);
  H5Ldelete(file, from.c_str(), H5P_DEFAULT);
  H5Lcreate_soft(to.c_str(), file, from.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(file);
}
void link_to_file(const std::string& path, const std::string& from, const std::string& other) {
  const hid_t file = open_to_change(path);
  H5Ldelete(file, from.c_str(), H5P_DEFAULT);
  H5Lcreate_external(other.c_str(), "/time", file, from.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(file);
}
void make_huge(const std::string& path, const std::string& dataset, int rank) {
  const hid_t file = open_to_change(path);
  H5Ldelete(file, dataset.c_str(), H5P_DEFAULT);
  const std::vector<hsize_t> shape(static_cast<std::size_t>(rank), hsize_t{1} << 31), chunk(static_cast<std::size_t>(rank), 64);
  const hid_t space = H5Screate_simple(rank, shape.data(), nullptr), properties = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(properties, rank, chunk.data());
  H5Dclose(H5Dcreate2(file, dataset.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, properties, H5P_DEFAULT));
  H5Pclose(properties);
  H5Sclose(space);
  H5Fclose(file);
}
void make_external(const std::string& path, const std::string& dataset, const std::string& other) {
  const hid_t file = open_to_change(path);
  H5Ldelete(file, dataset.c_str(), H5P_DEFAULT);
  const hsize_t size = 10;
  const hid_t space = H5Screate_simple(1, &size, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_external(properties, other.c_str(), 0, 8 * size);
  H5Dclose(H5Dcreate2(file, dataset.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, properties, H5P_DEFAULT));
  H5Pclose(properties);
  H5Sclose(space);
  H5Fclose(file);
}

}  // namespace cardan::fuzz
