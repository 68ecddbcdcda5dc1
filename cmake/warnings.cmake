# SPDX-License-Identifier: BSL-1.0

# cles_target_warnings(target): enables warnings for our own code. Headers of other projects count as system
# headers, which are excluded.
function(cles_target_warnings target)
    if(NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
        return()
    endif()

    # Not -Wnon-virtual-dtor, which warns about every error category written as Boost requires; -Wall includes
    # -Wdelete-non-virtual-dtor, which reports incorrect deletions.
    set(flags
        -Wall
        -Wextra
        -Wpedantic
        -Wcast-align
        -Wcast-qual
        -Wconversion
        -Wextra-semi
        -Wformat=2
        -Wimplicit-fallthrough
        -Wold-style-cast
        -Woverloaded-virtual
        -Wredundant-decls
        -Wshadow
        -Wunused
        # Options are passed as designated initializers, which omit members on purpose.
        -Wno-missing-field-initializers)

    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
        list(APPEND flags -Wduplicated-branches -Wduplicated-cond -Wlogical-op -Wsuggest-override)
        if(CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
            # g++ 12 sees overlapping copies in std::string's operator+ (GCC bug 105651).
            list(APPEND flags -Wno-restrict)
        endif()
    endif()

    if(CLES_WERROR)
        list(APPEND flags -Werror)
    endif()
    target_compile_options(${target} PRIVATE ${flags})
endfunction()
