# SPDX-License-Identifier: BSL-1.0
# Records the settings of this project, for after.cmake.

set(settings
    BOOST_ROOT
    BUILD_SHARED_LIBS
    BUILD_TESTING
    Boost_NO_WARN_NEW_VERSIONS
    Boost_USE_STATIC_LIBS
    CMAKE_BUILD_TYPE
    CMAKE_CXX_COMPILER_LAUNCHER
    CMAKE_CXX_EXTENSIONS
    CMAKE_CXX_FLAGS
    CMAKE_CXX_STANDARD
    CMAKE_CXX_STANDARD_REQUIRED
    CMAKE_EXE_LINKER_FLAGS
    CMAKE_EXPORT_COMPILE_COMMANDS
    CMAKE_MODULE_PATH
    CMAKE_POSITION_INDEPENDENT_CODE
    PROJECT_NAME
    PROJECT_VERSION)
foreach(setting IN LISTS settings)
    if(DEFINED ${setting})
        set("before_${setting}" "is '${${setting}}'")
    else()
        set("before_${setting}" "is not set")
    endif()
endforeach()
set(folder_properties COMPILE_DEFINITIONS COMPILE_OPTIONS INCLUDE_DIRECTORIES LINK_LIBRARIES LINK_OPTIONS)
foreach(property IN LISTS folder_properties)
    get_property("before_${property}" DIRECTORY PROPERTY "${property}")
endforeach()
