# SPDX-License-Identifier: BSL-1.0

# What `cmake --install` installs, and where. The installed tree may be moved: the only path of this machine in it is
# that of Boost, if Boost is outside the compiler's default folders.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(cles_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/cles")

# --- Headers and the library -------------------------------------------------------------------------------------------

set(cles_headers_left_out)
if(NOT TARGET cles_security)
    set(cles_headers_left_out PATTERN "security" EXCLUDE PATTERN "security.hpp" EXCLUDE)
endif()
if(NOT TARGET cles_federation)
    list(APPEND cles_headers_left_out PATTERN "federation.hpp" EXCLUDE)
endif()
install(DIRECTORY libcles/include/cles DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
    FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp" ${cles_headers_left_out})
install(TARGETS cles cles_plugin EXPORT cles-targets
    ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}"
    INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")

# With targets of their own, because only programs with security need OpenSSL and libsodium.
if(TARGET cles_security)
    set_target_properties(cles_security PROPERTIES EXPORT_NAME security)
    set_target_properties(cles_tls PROPERTIES EXPORT_NAME tls)
    install(TARGETS cles_security cles_tls EXPORT cles-security-targets
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}"
        INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
    install(EXPORT cles-security-targets NAMESPACE cles:: DESTINATION "${cles_package_dir}")
endif()

if(TARGET cles_federation)
    set_target_properties(cles_federation PROPERTIES EXPORT_NAME federation)
    install(TARGETS cles_federation EXPORT cles-federation-targets
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}"
        INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
    install(EXPORT cles-federation-targets NAMESPACE cles:: DESTINATION "${cles_package_dir}")
endif()

# --- find_package(cles) ------------------------------------------------------------------------------------------------

install(EXPORT cles-targets NAMESPACE cles:: DESTINATION "${cles_package_dir}")
configure_package_config_file(cmake/cles-config.cmake.in "${PROJECT_BINARY_DIR}/package/cles-config.cmake"
    INSTALL_DESTINATION "${cles_package_dir}"
    NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/package/cles-config-version.cmake"
    COMPATIBILITY SameMajorVersion)
install(FILES
    "${PROJECT_BINARY_DIR}/package/cles-config.cmake"
    "${PROJECT_BINARY_DIR}/package/cles-config-version.cmake"
    cmake/cles-plugin.cmake
    cmake/cles-plugin.map
    DESTINATION "${cles_package_dir}")

# --- pkg-config --------------------------------------------------------------------------------------------------------

# cles_flags_of_boost(cflags libs): the flags that g++ needs for the Boost that the library was built with, because
# Boost has no pkg-config files. The name of the library file determines static or shared linking.
function(cles_flags_of_boost cflags_out libs_out)
    set(cflags "")
    get_target_property(includes Boost::headers INTERFACE_INCLUDE_DIRECTORIES)
    foreach(folder IN LISTS includes)
        if(NOT folder IN_LIST CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES)
            string(APPEND cflags " -isystem ${folder}")
        endif()
    endforeach()

    set(libs "")
    get_target_property(file Boost::json IMPORTED_LOCATION_RELEASE)
    if(NOT file)
        get_target_property(file Boost::json LOCATION)
    endif()
    get_filename_component(folder "${file}" DIRECTORY)
    get_filename_component(name "${file}" NAME)
    if(NOT folder IN_LIST CMAKE_CXX_IMPLICIT_LINK_DIRECTORIES)
        string(APPEND libs " -L${folder}")
    endif()
    string(APPEND libs " -l:${name}")

    set(${cflags_out} "${cflags}" PARENT_SCOPE)
    set(${libs_out} "${libs}" PARENT_SCOPE)
endfunction()

cles_flags_of_boost(cles_pc_cflags cles_pc_libs)
file(RELATIVE_PATH cles_pc_prefix "${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig" "${CMAKE_INSTALL_PREFIX}")
string(REGEX REPLACE "/$" "" cles_pc_prefix "${cles_pc_prefix}")
configure_file(cmake/cles.pc.in "${PROJECT_BINARY_DIR}/package/cles.pc" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/package/cles.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
if(TARGET cles_security)
    configure_file(cmake/cles-tls.pc.in "${PROJECT_BINARY_DIR}/package/cles-tls.pc" @ONLY)
    install(FILES "${PROJECT_BINARY_DIR}/package/cles-tls.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
endif()

# --- The programs ------------------------------------------------------------------------------------------------------

foreach(program IN ITEMS cles_command cles_bench cles_gateway clesd)
    if(TARGET ${program})
        install(TARGETS ${program} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
    endif()
endforeach()

# --- The daemon and the gateway as services ----------------------------------------------------------------------------

if(TARGET clesd)
    set(units clesd)
    if(TARGET cles_gateway)
        list(APPEND units cles-gateway)
    endif()
    install(CODE "
        set(CLES_UNITS [[${units}]])
        set(CLES_SOURCE_DIR [[${PROJECT_SOURCE_DIR}]])
        set(CLES_BINDIR [[${CMAKE_INSTALL_BINDIR}]])
        set(CLES_SYSCONFDIR [[${CMAKE_INSTALL_SYSCONFDIR}]])")
    install(SCRIPT cmake/install_service.cmake)
endif()

# --- Plugins -----------------------------------------------------------------------------------------------------------

foreach(plugin IN ITEMS cles_plugin_system cles_plugin_primes)
    if(TARGET ${plugin})
        install(TARGETS ${plugin} LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/cles")
    endif()
endforeach()

# --- The case studies --------------------------------------------------------------------------------------------------

# Only installed by `cmake --install BUILD --component case_studies`.
foreach(target IN ITEMS cles_dsgd cles_jadc2 cles_platoon cles_plugin_digits cles_plugin_sgd cles_plugin_fmv
        cles_plugin_strike)
    if(TARGET ${target})
        install(TARGETS ${target}
            RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT case_studies EXCLUDE_FROM_ALL
            LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/cles" COMPONENT case_studies EXCLUDE_FROM_ALL)
    endif()
endforeach()

# --- The licence and the pages -----------------------------------------------------------------------------------------

# With the folders of the source tree, so that links between pages work.
install(FILES LICENSE README.md CONTRIBUTING.md DESTINATION "${CMAKE_INSTALL_DOCDIR}")
install(DIRECTORY config docs DESTINATION "${CMAKE_INSTALL_DOCDIR}"
    PATTERN "*.in" EXCLUDE PATTERN "*.sysusers" EXCLUDE)
install(DIRECTORY plugins/primes plugins/template DESTINATION "${CMAKE_INSTALL_DOCDIR}/plugins")
install(DIRECTORY python DESTINATION "${CMAKE_INSTALL_DOCDIR}" PATTERN "__pycache__" EXCLUDE)
install(DIRECTORY apps/examples DESTINATION "${CMAKE_INSTALL_DOCDIR}/apps"
    FILES_MATCHING PATTERN "*.cpp" PATTERN "*.hpp")

# --- Completion --------------------------------------------------------------------------------------------------------

# The default folders of each shell.
if(TARGET cles_command)
    install(FILES apps/completion/cles.bash DESTINATION "${CMAKE_INSTALL_DATADIR}/bash-completion/completions" RENAME cles)
    install(FILES apps/completion/_cles DESTINATION "${CMAKE_INSTALL_DATADIR}/zsh/site-functions")
    install(FILES apps/completion/cles.fish DESTINATION "${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d")
endif()
