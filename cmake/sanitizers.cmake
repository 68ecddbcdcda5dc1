# SPDX-License-Identifier: BSL-1.0

# A fast linker for the programs of the tests, and for those with sanitizers: the first of these that the system has.
if(CLES_SANITIZE OR CLES_BUILD_TESTS)
    include(CheckLinkerFlag)
    foreach(linker IN ITEMS mold lld gold)
        check_linker_flag(CXX "-fuse-ld=${linker}" CLES_LINKER_${linker})
        if(CLES_LINKER_${linker})
            set(CLES_FAST_LINKER "-fuse-ld=${linker}")
            break()
        endif()
    endforeach()
endif()

# cles_target_sanitizers(target): instruments the target as CLES_SANITIZE says. Nothing recovers: the first finding ends
# the program, so that no test passes over one.
function(cles_target_sanitizers target)
    if(NOT CLES_SANITIZE)
        return()
    endif()

    string(REPLACE ";" "," kinds "${CLES_SANITIZE}")
    set(flags -fsanitize=${kinds} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    set(quiet)

    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
        if("thread" IN_LIST CLES_SANITIZE)
            # Asio's fences: g++ warns of each that it cannot instrument.
            list(APPEND quiet -Wno-tsan)
        endif()
        if("address" IN_LIST CLES_SANITIZE)
            # Instrumented Asio looks uninitialized to g++ 12. The builds without sanitizers keep this warning.
            list(APPEND quiet -Wno-maybe-uninitialized)
        endif()
        if("undefined" IN_LIST CLES_SANITIZE AND CLES_SANITIZE_TRAP)
            list(APPEND flags -fsanitize-undefined-trap-on-error)
        endif()
    elseif("undefined" IN_LIST CLES_SANITIZE)
        # clang 14's check of function types breaks Asio's coroutines.
        list(APPEND flags -fno-sanitize=function)
    endif()

    target_compile_options(${target} PRIVATE ${flags} ${quiet})
    # A program that links an instrumented library needs the runtime, too.
    target_link_options(${target} PUBLIC ${flags})
    target_link_options(${target} PRIVATE ${CLES_FAST_LINKER})

    get_target_property(type ${target} TYPE)
    if(type STREQUAL "EXECUTABLE" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND "address" IN_LIST CLES_SANITIZE)
        # The tables of the sanitizers contain a million addresses. At a fixed position, the linker writes them, instead of
        # the loader at each start.
        target_link_options(${target} PRIVATE -no-pie)
    endif()
endfunction()

# cles_target_tests_only(target): for test code. It omits the checks of each pointer, which take half the compile
# time; the library's own code has them. Invalid reads and writes are detected in both. And it has no section for each
# function, which takes a tenth of the time: what a test program does not use may stay in it.
function(cles_target_tests_only target)
    target_compile_options(${target} PRIVATE -fno-function-sections -fno-data-sections)
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "EXECUTABLE")
        target_link_options(${target} PRIVATE ${CLES_FAST_LINKER})
    endif()
    if("undefined" IN_LIST CLES_SANITIZE)
        target_compile_options(${target} PRIVATE -fno-sanitize=alignment,null,object-size,pointer-overflow,vptr)
    endif()
endfunction()

# cles_target_computes(target): for code in which the tests spend most of their time. It is optimised in the builds with
# sanitizers, where everything else is not, since that takes longer than it saves.
function(cles_target_computes target)
    if(CLES_SANITIZE)
        target_compile_options(${target} PRIVATE -O1)
    endif()
endfunction()

# CLES_TEST_LAUNCHER: the prefix of a test's command. Each test runs in a network namespace of its own. And g++ 12's thread
# sanitizer cannot start where the kernel spreads addresses over more than 28 bits, so there the tests run with that turned
# off.
set(CLES_TEST_LAUNCHER "${PROJECT_SOURCE_DIR}/test/support/isolated")
if("thread" IN_LIST CLES_SANITIZE AND EXISTS /proc/sys/vm/mmap_rnd_bits)
    file(READ /proc/sys/vm/mmap_rnd_bits cles_rnd_bits)
    string(STRIP "${cles_rnd_bits}" cles_rnd_bits)
    find_program(CLES_SETARCH setarch)
    mark_as_advanced(CLES_SETARCH)
    if(cles_rnd_bits GREATER 28 AND CLES_SETARCH)
        execute_process(COMMAND ${CLES_SETARCH} -R true RESULT_VARIABLE cles_setarch_result OUTPUT_QUIET ERROR_QUIET)
        if(cles_setarch_result EQUAL 0)
            list(APPEND CLES_TEST_LAUNCHER ${CLES_SETARCH} -R)
        endif()
    endif()
endif()
