# SPDX-License-Identifier: BSL-1.0

# Installs what systemd needs to run clesd and cles-gateway, and the daemon's configuration. A script of the installation,
# because units contain absolute paths, and `cmake --install BUILD --prefix PREFIX` may choose the prefix. It is given
# CLES_SOURCE_DIR, CLES_BINDIR, CLES_SYSCONFDIR and CLES_UNITS.
get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
get_filename_component(programs "${CLES_BINDIR}" ABSOLUTE BASE_DIR "${prefix}")
get_filename_component(settings "${CLES_SYSCONFDIR}" ABSOLUTE BASE_DIR "${prefix}")
if(settings STREQUAL "/usr/etc")
    set(settings /etc)
endif()

# In a unit, '%' begins a specifier.
string(REPLACE "%" "%%" CLES_UNIT_PROGRAM "${programs}/clesd")
string(REPLACE "%" "%%" CLES_UNIT_CONFIG "${settings}/cles/clesd.yaml")
string(REPLACE "%" "%%" CLES_UNIT_GATEWAY "${programs}/cles-gateway")
string(REPLACE "%" "%%" CLES_UNIT_SETTINGS "${settings}/cles")
foreach(name IN LISTS CLES_UNITS)
    file(READ "${CLES_SOURCE_DIR}/config/${name}.service.in" unit)
    string(CONFIGURE "${unit}" unit @ONLY)
    set(file "${prefix}/lib/systemd/system/${name}.service")
    message(STATUS "Installing: $ENV{DESTDIR}${file}")
    file(WRITE "$ENV{DESTDIR}${file}" "${unit}")
    file(CHMOD "$ENV{DESTDIR}${file}" PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
    list(APPEND CMAKE_INSTALL_MANIFEST_FILES "${file}")
endforeach()

file(INSTALL "${CLES_SOURCE_DIR}/config/cles.sysusers" DESTINATION "${prefix}/lib/sysusers.d" TYPE FILE RENAME cles.conf)

# Once: later it is the user's.
if(NOT EXISTS "$ENV{DESTDIR}${settings}/cles/clesd.yaml")
    file(INSTALL "${CLES_SOURCE_DIR}/config/clesd.yaml" DESTINATION "${settings}/cles" TYPE FILE)
endif()
