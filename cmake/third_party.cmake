# Everything that is not ours, but for the peers of the benchmark (bench/peers). Who may use which library: docs/architecture.md,
# enforced by check_layers.cmake.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt 9 REQUIRED)
find_package(yaml-cpp 0.7 REQUIRED)
find_package(tinyxml2 9 REQUIRED)
find_package(SUNDIALS 6.4 REQUIRED COMPONENTS arkode cvodes ida nvecserial sunmatrixdense sunmatrixsparse sunlinsoldense sunlinsolspgmr
             sunnonlinsolfixedpoint sunnonlinsolnewton)
set(HDF5_PREFER_PARALLEL OFF)
find_package(HDF5 1.10 REQUIRED COMPONENTS C)
find_package(OpenSSL 3.0 REQUIRED)   # SHA-256 of the inputs; libhdf5-dev brings it
find_package(nlohmann_json 3.11 REQUIRED)
find_package(CLI11 2.1 REQUIRED)
find_package(Boost 1.74 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(lua REQUIRED IMPORTED_TARGET lua5.4-c++)
pkg_check_modules(libedit REQUIRED IMPORTED_TARGET libedit)
# ARPACK with the reference BLAS and LAPACK, all three static: the bits do not depend on which BLAS a machine has, and no
# BLAS starts threads, which wait for ever where memory for their stacks is short.
find_path(ARPACK_INCLUDE arpack/arpack.hpp REQUIRED)
find_library(ARPACK_LIB libarpack.a REQUIRED)
find_library(LAPACK_LIB liblapack.a PATH_SUFFIXES lapack REQUIRED)
find_library(BLAS_LIB libblas.a PATH_SUFFIXES blas REQUIRED)
set(ARPACK_LIBRARIES ${ARPACK_LIB} ${LAPACK_LIB} ${BLAS_LIB} gfortran)
# Time scales, precession and nutation, ephemerides (BSD-3).
find_path(ERFA_INCLUDE erfa.h REQUIRED)
find_library(ERFA_LIB liberfa.a REQUIRED)
if(CARDAN_CHOLMOD)
  find_path(CHOLMOD_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
  find_library(CHOLMOD_LIB cholmod REQUIRED)
endif()
if(CARDAN_TESTS)
  find_package(GTest 1.12 REQUIRED)
  include(GoogleTest)
endif()
