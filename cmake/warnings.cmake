# SPDX-License-Identifier: BSL-1.0

# cles_target_warnings(target): the warnings that our own code is held to. Headers of other projects count as system
# headers and are not.
function(cles_target_warnings target)
    if(NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
        return()
    endif()

    # Not -Wnon-virtual-dtor, which trips over every error category made by Boost's rules; -Wall brings
    # -Wdelete-non-virtual-dtor, which reports the deletions that would go wrong.
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
        # Options are given by designated initializers, which are there to leave members out.
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
