// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/errors.hpp"
#include "trust/carried_file.hpp"

#include <stdexcept>
#include <string>

namespace tool {

/// \throws usage_error unless a new member may have this name
void check_node_name(const std::string& name);

/// Creates the folders that contain this one.
void create_parents(const std::string& directory);

/// The path of what has this name in a folder. For names of members, see cles/security/member_names.hpp.
std::string in_folder(const std::string& directory, const std::string& name);

/// Calls `use`; names the file that was carried here in its error.
template <class Use>
auto naming_file(const std::string& file, Use use) {
    try {
        return use();
    } catch (const usage_error&) {
        throw;
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(carried_file_name(file) + ": " + e.what());
    }
}

} // namespace tool
