# SPDX-License-Identifier: BSL-1.0
# Compares with before.cmake: the library brings a target, and changes nothing else.

foreach(setting IN LISTS settings)
    set(now "is not set")
    if(DEFINED ${setting})
        set(now "is '${${setting}}'")
    endif()
    if(NOT "${now}" STREQUAL "${before_${setting}}")
        message(SEND_ERROR "${setting} ${before_${setting}} before, and ${now} now")
    endif()
endforeach()
foreach(property IN LISTS folder_properties)
    get_property(now DIRECTORY PROPERTY "${property}")
    if(NOT "${now}" STREQUAL "${before_${property}}")
        message(SEND_ERROR "${property} of this folder was '${before_${property}}' before, and is '${now}' now")
    endif()
endforeach()

# What every user of the target is compiled with: nothing but what the headers need.
get_target_property(options cles::cles INTERFACE_COMPILE_OPTIONS)
if(options)
    message(SEND_ERROR "cles::cles compiles its users with ${options}")
endif()
get_target_property(options cles::cles INTERFACE_LINK_OPTIONS)
if(options)
    message(SEND_ERROR "cles::cles links its users with ${options}")
endif()
get_target_property(definitions cles::cles INTERFACE_COMPILE_DEFINITIONS)
if(NOT "${definitions}" MATCHES "^BOOST_ASIO_NO_DEPRECATED;\\$<[^;]+:BOOST_ASIO_SEPARATE_COMPILATION>$")
    message(SEND_ERROR "cles::cles defines ${definitions}")
endif()

# What plugins are made with is built for those who name it.
get_target_property(left_out cles_plugin EXCLUDE_FROM_ALL)
if(NOT left_out)
    message(SEND_ERROR "cles_plugin is built whether it is used or not")
endif()

# Programs, measurements and tests are there where they were asked for, and only there.
function(targets_below folder out)
    get_property(targets DIRECTORY "${folder}" PROPERTY BUILDSYSTEM_TARGETS)
    get_property(inner_folders DIRECTORY "${folder}" PROPERTY SUBDIRECTORIES)
    foreach(inner IN LISTS inner_folders)
        targets_below("${inner}" more)
        list(APPEND targets ${more})
    endforeach()
    set(${out} "${targets}" PARENT_SCOPE)
endfunction()
targets_below("${CLES_SOURCE_DIR}" targets)
if(NOT DEFINED EXPECTED_TARGETS)
    set(EXPECTED_TARGETS cles cles_compact cles_plugin)
    if(NOT "${targets}" STREQUAL "cles;cles_compact;cles_plugin")
        message(SEND_ERROR "these targets came along: ${targets}")
    endif()
endif()
foreach(expected IN LISTS EXPECTED_TARGETS)
    if(NOT expected IN_LIST targets)
        message(SEND_ERROR "there is no target ${expected}, though it was asked for")
    endif()
endforeach()

# The library is compiled anew here. One precompiled header and no optimisation, which is this project's choice to make,
# keep that short.
target_precompile_headers(cles PRIVATE <boost/asio.hpp> <functional> <map> <memory> <string> <vector>)
target_compile_options(cles PRIVATE -fpch-preprocess) # ccache needs it
