# Where the C library goes without Python: lib/, include/, files for pkg-config and for CMake, options, examples
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# before version 1 each minor version may break binary interfaces
set_target_properties(latinpc PROPERTIES
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
  INSTALL_RPATH "${PETSC_LIBRARY_DIRS}" EXPORT_NAME latinpc)
install(TARGETS latinpc EXPORT latinpcTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(FILES include/latinpc.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
if(TARGET fortran_module)
  install(FILES ${FORTRAN_MODULE} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
endif()
install(DIRECTORY ../options/ DESTINATION ${CMAKE_INSTALL_DATADIR}/latinpc/options FILES_MATCHING PATTERN "*.opts")
install(FILES ../LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/latinpc)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/latinpc)
install(EXPORT latinpcTargets NAMESPACE latinpc:: DESTINATION ${package})
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/latinpcConfig.cmake [[
# latinpc::latinpc, with PETSc and MPI; latinpc::fortran besides, for programs with `use latinpc`: it is compiled with them
include(CMakeFindDependencyMacro)
enable_language(C) # MPI is looked for in C, also for projects of C++ or Fortran
find_dependency(MPI COMPONENTS C)
include(${CMAKE_CURRENT_LIST_DIR}/latinpcTargets.cmake)
get_target_property(latinpc_include latinpc::latinpc INTERFACE_INCLUDE_DIRECTORIES)
find_file(latinpc_module latinpc.F90 PATHS ${latinpc_include} NO_DEFAULT_PATH NO_CACHE)
if(latinpc_module AND NOT TARGET latinpc::fortran)
  add_library(latinpc::fortran INTERFACE IMPORTED)
  target_sources(latinpc::fortran INTERFACE ${latinpc_module})
  target_compile_options(latinpc::fortran INTERFACE $<$<COMPILE_LANG_AND_ID:Fortran,GNU>:-ffree-line-length-0>)
  target_link_libraries(latinpc::fortran INTERFACE latinpc::latinpc)
endif()
]])
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/latinpcConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/latinpcConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/latinpcConfigVersion.cmake
  DESTINATION ${package})

# the library fits the PETSc that it was built with: its minor version
string(REGEX MATCH "^[0-9]+\\.[0-9]+" petsc "${PETSC_VERSION}")
string(REGEX REPLACE "^[0-9]+\\." "" next "${petsc}")
math(EXPR next "${next} + 1")
string(REGEX REPLACE "\\..*" ".${next}" next "${petsc}")
file(RELATIVE_PATH up "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/latinpc.pc @ONLY CONTENT [[
prefix=${pcfiledir}/@up@
libdir=${prefix}/@CMAKE_INSTALL_LIBDIR@
includedir=${prefix}/@CMAKE_INSTALL_INCLUDEDIR@

Name: latinpc
Description: Multiscale LATIN domain decomposition for structures of links, as PETSc solver types
Version: @PROJECT_VERSION@
Requires: @PETSC_MODULE_NAME@ >= @petsc@, @PETSC_MODULE_NAME@ < @next@
Libs: -L${libdir} -llatinpc
Cflags: -I${includedir}
]])
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/latinpc.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
