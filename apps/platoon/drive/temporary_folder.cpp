// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/temporary_folder.hpp"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace platoon {

temporary_folder::temporary_folder()
    : path_((std::filesystem::temp_directory_path() / "cles-platoon-XXXXXX").string()) {
    if (::mkdtemp(path_.data()) == nullptr) { // with the mode 0700
        throw std::system_error(errno, std::generic_category(), "a temporary folder, " + path_);
    }
}

temporary_folder::~temporary_folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

} // namespace platoon
