# SPDX-License-Identifier: BSL-1.0

# cles_target_defaults(target): every target of ours calls this once, after it is defined.
function(cles_target_defaults target)
    cles_target_warnings(${target})
    cles_target_sanitizers(${target})

    if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
        # One section per function, so that a program contains only what it uses.
        target_compile_options(${target} PRIVATE -ffunction-sections -fdata-sections)
        # Programs contain no path of the build machine.
        target_compile_options(${target} PRIVATE "-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=")

        get_target_property(type ${target} TYPE)
        if(type STREQUAL "EXECUTABLE" OR type STREQUAL "MODULE_LIBRARY" OR type STREQUAL "SHARED_LIBRARY")
            target_link_options(${target} PRIVATE LINKER:--gc-sections)
        endif()
    endif()

    # The standard library checks its own preconditions in every build that is not for release.
    target_compile_definitions(${target} PRIVATE $<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS>)
endfunction()

# cles_target_in_units(target): with CLES_UNITY its sources are compiled several at a time. Compiling Asio's and the standard
# library's templates anew for each source is most of the work. A build without CLES_UNITY finds what a source fails to include.
function(cles_target_in_units target)
    if(CLES_UNITY)
        set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)
    endif()
endfunction()

# cles_target_in_folder_units(target FOLDER...): as above, with one unit for the sources of each folder of src/ and one for
# all others, so that the functions of a folder can be inlined into each other. A unit of any 12 sources adds 13 % to the
# instructions of a PULL at the service.
function(cles_target_in_folder_units target)
    if(NOT CLES_UNITY)
        return()
    endif()
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
    get_target_property(sources ${target} SOURCES)
    list(FILTER sources INCLUDE REGEX "\\.cpp$")
    foreach(source IN LISTS sources)
        set(unit other)
        foreach(folder IN LISTS ARGN)
            if(source MATCHES "^src/${folder}/")
                string(REPLACE "/" "_" unit ${folder})
            endif()
        endforeach()
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${unit})
    endforeach()
endfunction()
