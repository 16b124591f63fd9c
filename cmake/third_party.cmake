# Everything that is not ours, but for the peers of the benchmark (bench/peers). Who may use which library: docs/architecture.md,
# enforced by check_layers.cmake.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt 9 REQUIRED)
find_package(yaml-cpp 0.7 REQUIRED)
find_package(SUNDIALS 6.4 REQUIRED COMPONENTS cvodes nvecserial sunmatrixdense sunlinsoldense sunlinsolspgmr
             sunnonlinsolfixedpoint sunnonlinsolnewton)
set(HDF5_PREFER_PARALLEL OFF)
find_package(HDF5 1.10 REQUIRED COMPONENTS C)
find_package(OpenSSL 3.0 REQUIRED)   # SHA-256 of the inputs; libhdf5-dev brings it
find_package(nlohmann_json 3.11 REQUIRED)
find_package(CLI11 2.1 REQUIRED)
find_package(LAPACK REQUIRED)
find_package(Boost 1.74 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(lua REQUIRED IMPORTED_TARGET lua5.4-c++)
pkg_check_modules(libedit REQUIRED IMPORTED_TARGET libedit)
pkg_check_modules(arpack REQUIRED IMPORTED_TARGET arpack)
find_path(CHOLMOD_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
find_library(CHOLMOD_LIB cholmod REQUIRED)
if(CARDAN_TESTS)
  find_package(GTest 1.12 REQUIRED)
  include(GoogleTest)
endif()
