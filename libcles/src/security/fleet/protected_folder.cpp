// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/protected_folder.hpp"

#include "security/keys/keys.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <memory>
#include <utility>

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace cles::security {
namespace {

void require_none(const std::string& flaw) {
    if (!flaw.empty()) {
        throw security_error{flaw};
    }
}

// Reads until the end, or until the buffer is full.
std::size_t read_into(const descriptor& file, std::span<std::uint8_t> buffer, const std::string& path) {
    std::size_t size = 0;
    while (size < buffer.size()) {
        const auto count = read(file.get(), buffer.data() + size, buffer.size() - size);
        if (count == 0) {
            break;
        }
        if (count < 0 && errno != EINTR) {
            fail_with(errno, "cannot read " + path);
        }
        size += count > 0 ? static_cast<std::size_t>(count) : 0;
    }
    return size;
}

void write_all(const descriptor& file, bytes_view content, const std::string& path) {
    while (!content.empty()) {
        const auto count = write(file.get(), content.data(), content.size());
        if (count < 0 && errno != EINTR) {
            fail_with(errno, "cannot write " + path);
        }
        content = content.subspan(count > 0 ? static_cast<std::size_t>(count) : 0);
    }
}

} // namespace

protected_folder::protected_folder(std::string path)
    : path_(std::move(path)), folder_(open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (!folder_.is_open()) {
        fail_with(errno, "cannot open the folder " + path_);
    }
    const auto status = status_of(folder_, path_);
    require_none(owner_flaw(status, path_));
    require_none(mode_flaw(status, path_));
}

protected_folder protected_folder::create(std::string path) {
    if (mkdir(path.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
        fail_with(errno, "cannot create the folder " + path);
    }
    return protected_folder{std::move(path)};
}

std::string protected_folder::path_of(std::string_view name) const {
    std::string full{path_};
    return full.append(path_.ends_with('/') ? "" : "/").append(name);
}

struct protected_folder::opened {
    descriptor file;
    std::size_t size = 0;
};

protected_folder::opened protected_folder::open_file(const std::string& name, access who, std::size_t max_size) const {
    const auto path = path_of(name);
    // A FIFO without a writer would otherwise be waited for.
    descriptor file{openat(folder_.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)};
    if (!file.is_open()) {
        if (errno == ENOENT) {
            return {};
        }
        if (errno == ELOOP) {
            throw security_error{path + " is a symbolic link: replace it by the file itself"};
        }
        fail_with(errno, "cannot open " + path);
    }
    const auto status = status_of(file, path);
    if (!S_ISREG(status.st_mode)) {
        throw security_error{path + " is not a regular file"};
    }
    require_none(owner_flaw(status, path));
    if (who == access::secret && (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        throw security_error{path + " is accessible to other users: chmod 600 " + shell_quoted(path)};
    }
    require_none(mode_flaw(status, path));
    const auto size = static_cast<std::size_t>(status.st_size);
    if (size > max_size) {
        throw security_error{path + " has " + std::to_string(size) + " bytes; at most " + std::to_string(max_size) +
                             " are possible"};
    }
    return {std::move(file), size};
}

std::optional<secret_bytes> protected_folder::read_secret(const std::string& name, std::size_t max_size) const {
    const auto [file, size] = open_file(name, access::secret, max_size);
    if (!file.is_open()) {
        return {};
    }
    secret_bytes content{size};
    if (read_into(file, content.span(), path_of(name)) != size) {
        throw security_error{path_of(name) + " has changed while it was read"};
    }
    return content;
}

std::optional<std::string> protected_folder::read_text(const std::string& name, std::size_t max_size) const {
    const auto [file, size] = open_file(name, access::readable, max_size);
    if (!file.is_open()) {
        return {};
    }
    std::string content(size, '\0');
    if (read_into(file, {reinterpret_cast<std::uint8_t*>(content.data()), size}, path_of(name)) != size) {
        throw security_error{path_of(name) + " has changed while it was read"};
    }
    return content;
}

std::string protected_folder::state_of(const std::vector<std::string>& names) const {
    std::string state;
    for (const auto& name : names) {
        struct stat status {};
        if (fstatat(folder_.get(), name.c_str(), &status, AT_SYMLINK_NOFOLLOW) != 0) {
            continue;
        }
        state.append(name);
        for (const auto part : {static_cast<std::int64_t>(status.st_ino), static_cast<std::int64_t>(status.st_size),
                                std::int64_t{status.st_mtim.tv_sec}, std::int64_t{status.st_mtim.tv_nsec},
                                std::int64_t{status.st_mode}, std::int64_t{status.st_uid}}) {
            state.append(" ").append(std::to_string(part));
        }
        state.push_back('\n');
    }
    return state;
}

std::vector<std::string> protected_folder::names_ending(std::string_view suffix) const {
    // A descriptor of its own, because the position in the folder belongs to the opened folder.
    const auto fd = openat(folder_.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const std::unique_ptr<DIR, int (*)(DIR*)> listing{fd < 0 ? nullptr : fdopendir(fd), closedir};
    if (!listing) {
        fail_with(errno, "cannot list the folder " + path_);
    }
    std::vector<std::string> names;
    errno = 0;
    while (const auto* const entry = readdir(listing.get())) {
        const std::string_view name{&entry->d_name[0]};
        if (name.ends_with(suffix) && !name.starts_with('.')) {
            names.emplace_back(name);
        }
    }
    if (errno != 0) {
        fail_with(errno, "cannot list the folder " + path_);
    }
    std::ranges::sort(names);
    return names;
}

// Returns the name of a new file with this content, which no reader looks for.
std::string protected_folder::write_temporary(const std::string& name, bytes_view content, access who) const {
    std::array<std::uint8_t, 12> chance{};
    const auto drawn = secret_bytes::random(chance.size());
    std::ranges::copy(drawn.view(), chance.begin());
    auto temporary = "." + name + "." + to_base64url(chance);
    const auto path = path_of(temporary);
    const mode_t mode = who == access::secret ? S_IRUSR | S_IWUSR : S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
    const descriptor file{openat(folder_.get(), temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                                 S_IRUSR | S_IWUSR)};
    if (!file.is_open()) {
        fail_with(errno, "cannot create " + path);
    }
    try {
        write_all(file, content, path);
        // Whatever the umask is.
        if (fchmod(file.get(), mode) != 0 || fsync(file.get()) != 0) {
            fail_with(errno, "cannot write " + path);
        }
    } catch (...) {
        unlinkat(folder_.get(), temporary.c_str(), 0);
        throw;
    }
    return temporary;
}

void protected_folder::sync() const {
    if (fsync(folder_.get()) != 0) {
        fail_with(errno, "cannot write the folder " + path_);
    }
}

void protected_folder::create_file(const std::string& name, bytes_view content, access who) const {
    const auto temporary = write_temporary(name, content, who);
    // Unlike a renamed file, a link never replaces another file.
    const auto linked = linkat(folder_.get(), temporary.c_str(), folder_.get(), name.c_str(), 0);
    const auto code = errno;
    unlinkat(folder_.get(), temporary.c_str(), 0);
    if (linked != 0) {
        fail_with(code, "cannot create " + path_of(name));
    }
    sync();
}

void protected_folder::replace_file(const std::string& name, bytes_view content, access who) const {
    const auto temporary = write_temporary(name, content, who);
    if (renameat(folder_.get(), temporary.c_str(), folder_.get(), name.c_str()) != 0) {
        const auto code = errno;
        unlinkat(folder_.get(), temporary.c_str(), 0);
        fail_with(code, "cannot replace " + path_of(name));
    }
    sync();
}

descriptor protected_folder::lock(const std::string& name) const {
    const auto path = path_of(name);
    // With this mode, no other user can keep it locked.
    descriptor file{
        openat(folder_.get(), name.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, S_IRUSR | S_IWUSR)};
    if (!file.is_open()) {
        fail_with(errno, "cannot open " + path);
    }
    while (flock(file.get(), LOCK_EX) != 0) {
        if (errno != EINTR) {
            fail_with(errno, "cannot lock " + path);
        }
    }
    return file;
}

} // namespace cles::security
