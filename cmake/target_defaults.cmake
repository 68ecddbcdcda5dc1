# SPDX-License-Identifier: BSL-1.0

# g++ looks for garbage from 128 MB on, and touches all of a precompiled header each time. A machine with memory for a
# gigabyte in each of its compilers saves a sixth of the time.
cmake_host_system_information(RESULT cles_memory QUERY TOTAL_PHYSICAL_MEMORY) # in MB
cmake_host_system_information(RESULT cles_cores QUERY NUMBER_OF_LOGICAL_CORES)
math(EXPR cles_memory_per_core "${cles_memory} / ${cles_cores}")
set(cles_compiler_memory)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND PROJECT_IS_TOP_LEVEL AND cles_memory_per_core GREATER_EQUAL 1900)
    set(cles_compiler_memory --param=ggc-min-heapsize=1000000) # kB
endif()

# cles_target_defaults(target): every target of ours calls this once, after it is defined.
function(cles_target_defaults target)
    cles_target_warnings(${target})
    cles_target_sanitizers(${target})

    if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
        # One section per function, so that a program contains only what it uses.
        target_compile_options(${target} PRIVATE -ffunction-sections -fdata-sections ${cles_compiler_memory})
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

# cles_target_position_independent(target): for archives, so that shared libraries (of ROS, of Qt, of Python) can contain
# them, unless the project sets CMAKE_POSITION_INDEPENDENT_CODE. Without interposition, functions of a unit are inlined as in
# programs; the linker makes the calls of programs direct.
function(cles_target_position_independent target)
    if(NOT DEFINED CMAKE_POSITION_INDEPENDENT_CODE)
        set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    endif()
    if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
        target_compile_options(${target} PRIVATE -fno-semantic-interposition)
    endif()
endfunction()

# cles_target_runs_little(target): for programs that compute little themselves (the simulation mostly runs the library), so
# that compiling them faster gains more.
function(cles_target_runs_little target)
    target_compile_options(${target} PRIVATE $<$<AND:$<CONFIG:Release>,$<CXX_COMPILER_ID:GNU,Clang>>:-O1>
        # With -O1, g++ 12 sees another deallocation of a coroutine's frame than Asio's.
        $<$<AND:$<CONFIG:Release>,$<CXX_COMPILER_ID:GNU>>:-Wno-mismatched-new-delete>)
endfunction()

# cles_target_in_units(target [FOLDER...]): with CLES_UNITY its sources are compiled together, as units of 24 sources.
# Compiling Asio's and the standard library's templates anew for each source is most of the work. A build without CLES_UNITY
# finds what a source fails to include.
#
# With folders of src/ there is one unit for the sources of each, and one for all others, so that the functions of a folder can
# be inlined into each other. Units that ignore the folders add 13 % to the instructions of a PULL at the service.
#
# A source with SKIP_UNITY_BUILD_INCLUSION, or with options of its own, is compiled separately.
function(cles_target_in_units target)
    if(CLES_UNITY)
        # At the end of the directory, when all its sources and their properties are known. DEFER would expand the variables
        # only then.
        cmake_language(EVAL CODE "cmake_language(DEFER CALL cles_combine_sources ${target} [[${ARGN}]])")
    endif()
endfunction()

# CMake's own units name their sources by absolute paths, so that a compiler cache would preprocess them anew in each clone.
function(cles_combine_sources target folders)
    get_target_property(sources ${target} SOURCES)
    set(separate)
    set(units)
    set(count 0)
    foreach(source IN LISTS sources)
        set(alone NO)
        foreach(property IN ITEMS SKIP_UNITY_BUILD_INCLUSION HEADER_FILE_ONLY GENERATED SKIP_PRECOMPILE_HEADERS
                COMPILE_DEFINITIONS COMPILE_FLAGS COMPILE_OPTIONS INCLUDE_DIRECTORIES)
            get_source_file_property(value "${source}" ${property})
            if(value)
                set(alone YES)
            endif()
        endforeach()
        if(alone OR NOT source MATCHES "\\.cpp$")
            list(APPEND separate "${source}")
            continue()
        endif()
        if(folders)
            set(unit other)
            foreach(folder IN LISTS folders)
                if(source MATCHES "^src/${folder}/")
                    string(REPLACE "/" "_" unit ${folder})
                endif()
            endforeach()
        else()
            math(EXPR unit "${count} / 24")
            math(EXPR count "${count} + 1")
        endif()
        list(APPEND units ${unit})
        cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
        cmake_path(RELATIVE_PATH source BASE_DIRECTORY "${PROJECT_SOURCE_DIR}")
        string(APPEND text_of_${unit} "#include \"${source}\"\n")
    endforeach()
    list(REMOVE_DUPLICATES units)
    set(combined)
    foreach(unit IN LISTS units)
        set(file "${CMAKE_CURRENT_BINARY_DIR}/units/${target}_${unit}.cpp")
        file(CONFIGURE OUTPUT "${file}" CONTENT "${text_of_${unit}}" @ONLY)
        list(APPEND combined "${file}")
    endforeach()
    set_property(TARGET ${target} PROPERTY SOURCES ${combined} ${separate})
    set_property(TARGET ${target} PROPERTY UNITY_BUILD OFF) # a project that contains this one may set it for all targets
    target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
endfunction()
