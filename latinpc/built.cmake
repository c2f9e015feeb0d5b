# built.json: the PETSc and the packages that the library is built with, in words of their headers
function(latinpc_version result header pattern)
  set(numbers "")
  if(header AND EXISTS ${header})
    file(STRINGS ${header} lines REGEX "define +(${pattern})[ \t]")
    foreach(line ${lines})
      string(REGEX MATCH "\"?([0-9][0-9.]*)\"?[ \t]*(/\\*.*)?$" found "${line}")
      list(APPEND numbers "${CMAKE_MATCH_1}")
    endforeach()
  endif()
  list(JOIN numbers "." numbers)
  set(${result} "${numbers}" PARENT_SCOPE)
endfunction()

find_file(MUMPS_HEADER dmumps_c.h HINTS ${PETSC_INCLUDE_DIRS} ${PETSC_DIR}/${PETSC_ARCH}/include)
latinpc_version(mumps "${MUMPS_HEADER}" "MUMPS_VERSION")
latinpc_version(metis "${METIS_INCLUDE}/metis.h" "METIS_VER_(MAJOR|MINOR|SUBMINOR)")
if(CHOLMOD_INCLUDE AND CHOLMOD_LIBRARY)
  set(header "${CHOLMOD_INCLUDE}/cholmod_core.h") # before SuiteSparse 7
  if(NOT EXISTS ${header})
    set(header "${CHOLMOD_INCLUDE}/cholmod.h")
  endif()
  latinpc_version(cholmod "${header}" "CHOLMOD_(MAIN|SUB|SUBSUB)_VERSION")
endif()
set(hdf5 "false")
if(HDF5_INCLUDE)
  set(hdf5 "true")
endif()
file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/built.json @ONLY CONTENT [[
{
  "petsc": "@PETSC_VERSION@",
  "petsc_dir": "@PETSC_DIR@",
  "petsc_arch": "@PETSC_ARCH@",
  "metis": "@metis@",
  "cholmod": "@cholmod@",
  "mumps": "@mumps@",
  "hdf5": @hdf5@,
  "compiler": "@CMAKE_C_COMPILER_ID@ @CMAKE_C_COMPILER_VERSION@",
  "build_type": "@CMAKE_BUILD_TYPE@",
  "cython": "@CYTHON_VERSION@"
}
]])
if(LATINPC_INPLACE)
  configure_file(${CMAKE_CURRENT_BINARY_DIR}/built.json ${CMAKE_CURRENT_SOURCE_DIR}/built.json COPYONLY)
endif()
