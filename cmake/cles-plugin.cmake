# SPDX-License-Identifier: BSL-1.0

# cles_add_plugin(target source...): builds a plugin for clesd, named after the target with the suffix `.so`. It links
# cles::plugin and exports only its entry point, so that its symbols do not conflict with those of the daemon or of
# other plugins.
function(cles_add_plugin target)
    add_library(${target} MODULE ${ARGN})
    target_link_libraries(${target} PRIVATE cles::plugin)
    set_target_properties(${target} PROPERTIES
        PREFIX ""
        CXX_VISIBILITY_PRESET hidden
        VISIBILITY_INLINES_HIDDEN ON)
    if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang" AND NOT APPLE)
        set(symbols "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/cles-plugin.map")
        # Reports missing symbols when the plugin is linked, not when it is loaded.
        target_link_options(${target} PRIVATE "LINKER:--version-script=${symbols},--exclude-libs,ALL,-z,defs,--gc-sections")
        set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS "${symbols}")
    endif()
endfunction()
