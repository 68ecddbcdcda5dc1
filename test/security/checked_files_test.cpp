// SPDX-License-Identifier: BSL-1.0
#include <cles/security/checked_file.hpp>

#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

namespace checked_files {
namespace {

namespace fs = std::filesystem;
using cles::security::checked_file;
using namespace cles::security::test;

constexpr uid_t other_user = 54321;
constexpr gid_t other_group = 54321;

void set_mode(const fs::path& path, unsigned mode) { BOOST_REQUIRE(chmod(path.c_str(), mode) == 0); }

// A file in a folder of a folder, all of them safe.
struct fixture {
    fixture() {
        for (const auto* folder : {"lib", "lib/cles"}) {
            fs::create_directory(own / folder);
            set_mode(own / folder, 0755);
        }
        write_file(file, "abc");
        set_mode(file, 0755);
    }
    [[nodiscard]] std::string path(std::string_view name) const { return (own / name).string(); }
    [[nodiscard]] std::string flaw() const { return checked_file{file.string()}.flaw(); }
    void link(const std::string& target, std::string_view name) const { fs::create_symlink(target, own / name); }

    own_folder own{};
    fs::path file = own / "lib/cles/p.so";
};

std::string changeable(const std::string& path) { return path + " can be changed by other users: chmod go-w " + path; }

std::string content_of(const checked_file& file) {
    std::array<char, 100> read{};
    const auto size = pread(file.descriptor(), read.data(), read.size(), 0);
    return {read.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
}

std::string failure(const std::string& path) {
    return refusal([&] { return checked_file{path}.path(); });
}

// What another process returns, in which root has become another user.
int as_other_user(const std::function<int()>& call) {
    const auto child = fork();
    if (child == 0) {
        _exit(setgid(other_group) == 0 && setuid(other_user) == 0 ? call() : 99);
    }
    int status = 0;
    BOOST_REQUIRE(waitpid(child, &status, 0) == child);
    return WEXITSTATUS(status);
}

bool is_root() {
    if (geteuid() != 0) {
        BOOST_TEST_MESSAGE("only root can give files to another user");
    }
    return geteuid() == 0;
}

} // namespace

BOOST_FIXTURE_TEST_SUITE(checked_files, fixture)

// -- opening -------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_safe_file_has_no_flaw) {
    const checked_file opened{file.string()};
    BOOST_TEST(opened.path() == file.string());
    BOOST_TEST(opened.flaw() == "");
    BOOST_TEST(content_of(opened) == "abc");
    BOOST_TEST((fcntl(opened.descriptor(), F_GETFD) & FD_CLOEXEC) != 0);
}

BOOST_AUTO_TEST_CASE(the_path_is_absolute_and_without_links) {
    link("cles", "lib/same");
    link((own / "lib").string(), "elsewhere");
    link("p.so", "lib/cles/p.so.1");
    link("../elsewhere/same/p.so.1", "lib/far.so");
    for (const auto* name : {"lib/cles/p.so.1", "lib/same/p.so", "elsewhere/cles/p.so", "lib/far.so",
                             "lib/../lib/far.so", "lib/./cles//p.so", "elsewhere/../lib/cles/p.so"}) {
        BOOST_TEST(checked_file{path(name)}.path() == file.string());
        BOOST_TEST(checked_file{path(name)}.flaw() == "");
    }
    BOOST_TEST(checked_file{"/../.." + file.string()}.path() == file.string());
    const auto before = fs::current_path();
    fs::current_path(own / "lib");
    const auto found = checked_file{"./cles/../far.so"}.path();
    fs::current_path(before);
    BOOST_TEST(found == file.string());
}

BOOST_AUTO_TEST_CASE(what_is_not_a_regular_file_is_refused) {
    BOOST_REQUIRE(mkfifo(path("fifo").c_str(), 0600) == 0);
    link(".", "lib/here");
    for (const auto* name : {"lib", "fifo"}) {
        BOOST_TEST(failure(path(name)) == path(name) + " is not a regular file");
    }
    BOOST_TEST(failure(path("lib/here")) == path("lib") + " is not a regular file");
    BOOST_TEST(failure("/") == "/ is not a regular file");
    BOOST_TEST(failure("/dev/null") == "/dev/null is not a regular file");
}

BOOST_AUTO_TEST_CASE(what_cannot_be_opened_is_named_with_the_reason) {
    BOOST_TEST(failure(path("lib/b.so")) == "cannot open " + path("lib/b.so") + ": No such file or directory");
    BOOST_TEST(failure(path("bin/p.so")) == "cannot open " + path("bin") + ": No such file or directory");
    BOOST_TEST(failure(file.string() + "/x") == "cannot open " + file.string() + ": Not a directory");
    BOOST_TEST(failure(file.string() + "/") == "cannot open " + file.string() + ": Not a directory");
    link("missing", "lib/dangling");
    BOOST_TEST(failure(path("lib/dangling")) == "cannot open " + path("lib/missing") + ": No such file or directory");
    link("around", "around");
    BOOST_TEST(failure(path("around")) == "cannot open " + path("around") + ": Too many levels of symbolic links");
    BOOST_TEST(failure(path("around/p.so")) == "cannot open " + path("around") + ": Too many levels of symbolic links");
    if (geteuid() != 0) {
        set_mode(file, 0);
        BOOST_TEST(failure(file.string()) == "cannot open " + file.string() + ": Permission denied");
    }
}

BOOST_AUTO_TEST_CASE(a_file_that_is_replaced_stays_the_opened_one) {
    const checked_file opened{file.string()};
    write_file(path("lib/new"), "xyz");
    fs::rename(path("lib/new"), file);
    BOOST_TEST(content_of(opened) == "abc");
    BOOST_TEST(content_of(checked_file{file.string()}) == "xyz");
}

// -- who can change it ---------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_file_that_others_can_write) {
    for (const unsigned mode : {0646U, 0666U, 0757U, 0777U, 0602U}) {
        set_mode(file, mode);
        BOOST_TEST(flaw() == changeable(file.string()));
    }
    for (const unsigned mode : {0644U, 0755U, 0600U, 0444U, 04755U}) {
        set_mode(file, mode);
        BOOST_TEST(flaw() == "");
    }
}

BOOST_AUTO_TEST_CASE(a_folder_above_that_others_can_write) {
    for (const auto* folder : {"lib/cles", "lib", ""}) {
        const auto where = (own / folder).string();
        const auto shown = where.ends_with('/') ? own.path() : where;
        set_mode(where, 0757);
        BOOST_TEST(flaw() == changeable(shown));
        // Then only the owner of a file can replace it.
        set_mode(where, 01777);
        BOOST_TEST(flaw() == "");
        set_mode(where, 0755);
    }
}

BOOST_AUTO_TEST_CASE(the_folder_of_a_link_counts_too) {
    fs::create_directory(own / "links");
    link("../lib/cles/p.so", "links/p.so");
    set_mode(own / "links", 0777);
    BOOST_TEST(checked_file{path("links/p.so")}.flaw() == changeable(path("links")));
}

BOOST_AUTO_TEST_CASE(the_group_of_other_users) {
    if (!is_root()) {
        return;
    }
    for (const auto* name : {"lib/cles/p.so", "lib/cles", "lib"}) {
        BOOST_REQUIRE(chown(path(name).c_str(), 0, other_group) == 0);
        BOOST_TEST(flaw() == "");
        set_mode(path(name), 0775);
        BOOST_TEST(flaw() == changeable(path(name)));
        set_mode(path(name), 0755);
    }
}

// As with the mode 0664 of the private group: the group's permissions are those of the list.
BOOST_AUTO_TEST_CASE(an_access_control_list) {
    struct entry {
        std::uint16_t tag;
        std::uint16_t permissions;
        std::uint32_t id;
    };
    struct {
        std::uint32_t version = 2;
        std::array<entry, 5> entries{
            {{0x01, 6, ~0U}, {0x02, 6, geteuid()}, {0x04, 4, ~0U}, {0x10, 6, ~0U}, {0x20, 4, ~0U}}};
    } const list;
    set_mode(file, 0664);
    const auto before = flaw(); // depends on this user's groups
    if (setxattr(file.c_str(), "system.posix_acl_access", &list, sizeof list, 0) != 0) {
        BOOST_TEST_MESSAGE("this file system has no access control lists");
        BOOST_TEST((errno == EOPNOTSUPP || errno == EPERM));
        return;
    }
    BOOST_TEST((before.empty() || before == changeable(file.string())));
    BOOST_TEST(flaw() == changeable(file.string()));
}

BOOST_AUTO_TEST_CASE(files_folders_and_links_of_other_users) {
    if (!is_root()) {
        return;
    }
    const auto give = [&](std::string_view name, uid_t user) {
        BOOST_REQUIRE(lchown(path(name).c_str(), user, 0) == 0);
    };
    give("lib/cles/p.so", other_user);
    BOOST_TEST(flaw() == file.string() + " belongs to the user 54321, not to root: chown root " + file.string());
    give("lib/cles/p.so", 0);
    for (const auto* folder : {"lib/cles", "lib"}) {
        give(folder, other_user);
        BOOST_TEST(flaw() ==
                   path(folder) + " belongs to the user 54321, who can replace what is in it: use another folder");
        give(folder, 0);
    }
    link("cles/p.so", "lib/link.so");
    give("lib/link.so", other_user);
    const auto linked = checked_file{path("lib/link.so")}.flaw();
    BOOST_TEST(linked == path("lib/link.so") + " is a symbolic link of the user 54321: replace it");
}

BOOST_AUTO_TEST_CASE(a_user_may_use_own_files_and_those_of_root) {
    if (!is_root()) {
        return;
    }
    set_mode(own.path(), 0755);
    const auto is_safe = [&] {
        return as_other_user([&] { return checked_file{file.string()}.flaw().empty() ? 1 : 2; });
    };
    BOOST_TEST(is_safe() == 1);
    BOOST_REQUIRE(chown(path("lib/cles").c_str(), other_user, other_group) == 0);
    BOOST_REQUIRE(chown(file.c_str(), other_user, other_group) == 0);
    BOOST_TEST(is_safe() == 1);
    BOOST_REQUIRE(chown(path("lib").c_str(), other_user + 1, 0) == 0);
    BOOST_TEST(is_safe() == 2);
}

// -- what it contains ----------------------------------------------------------------------------------------------

// The first two are test vectors of FIPS 180-4, the third is from sha256sum.
BOOST_AUTO_TEST_CASE(the_sha256_of_the_content) {
    const auto sha256_of = [&](const std::string& content) {
        write_file(file, content);
        return checked_file{file.string()}.sha256();
    };
    BOOST_TEST(sha256_of("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    BOOST_TEST(sha256_of("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    BOOST_TEST(sha256_of(std::string(1'000'000, 'a')) ==
               "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

BOOST_AUTO_TEST_CASE(the_sha256_is_that_of_the_opened_file) {
    const checked_file opened{file.string()};
    fs::rename(file, path("lib/old"));
    write_file(file, "xyz");
    for (int i = 0; i < 2; ++i) {
        BOOST_TEST(opened.sha256() == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace checked_files
