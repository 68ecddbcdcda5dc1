// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/protected_folder.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <csignal>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

namespace protected_files {
namespace {

namespace fs = std::filesystem;
using namespace cles::security;
using namespace cles::security::test;
using file_access = protected_folder::access;

bytes_view bytes_of(std::string_view text) { return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}; }

std::string text_of(const secret_bytes& secret) { return {secret.view().begin(), secret.view().end()}; }

void set_mode(const fs::path& path, unsigned mode) { BOOST_REQUIRE(chmod(path.c_str(), mode) == 0); }

unsigned mode_of(const fs::path& path) {
    struct stat status {};
    BOOST_REQUIRE(lstat(path.c_str(), &status) == 0);
    return status.st_mode & 07777U;
}

struct fixture {
    own_folder own{};
    protected_folder folder{own.path()};

    void put(std::string_view name, std::string_view text, unsigned mode) const {
        write_file(own / name, text);
        set_mode(own / name, mode);
    }
    [[nodiscard]] std::string path(std::string_view name) const { return (own / name).string(); }
    [[nodiscard]] std::string secret_refusal(const std::string& name, std::size_t size = 100) const {
        return refusal([&] { return folder.read_secret(name, size); });
    }
    [[nodiscard]] std::string text_refusal(const std::string& name, std::size_t size = 100) const {
        return refusal([&] { return folder.read_text(name, size); });
    }
};

// The user that a root's test gives files to.
constexpr uid_t other_user = 54321;

// A limit of the size of files, for a while.
class file_size_limit {
  public:
    explicit file_size_limit(rlim_t bytes) {
        std::signal(SIGXFSZ, SIG_IGN);
        getrlimit(RLIMIT_FSIZE, &before_);
        rlimit limit = before_;
        limit.rlim_cur = bytes;
        BOOST_REQUIRE(setrlimit(RLIMIT_FSIZE, &limit) == 0);
    }
    file_size_limit(const file_size_limit&) = delete;
    file_size_limit& operator=(const file_size_limit&) = delete;
    ~file_size_limit() {
        setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, SIG_DFL);
    }

  private:
    rlimit before_{};
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(protected_files, fixture)

BOOST_AUTO_TEST_CASE(a_file_is_read) {
    put("secret", "text\n", 0600);
    BOOST_TEST(text_of(*folder.read_secret("secret", 100)) == "text\n");
    put("public", "text\n", 0644);
    BOOST_TEST(*folder.read_text("public", 100) == "text\n");
    put("empty", "", 0600);
    BOOST_TEST(folder.read_secret("empty", 100)->size() == 0U);
    BOOST_TEST(folder.read_text("empty", 100)->empty());
    BOOST_TEST(!folder.read_secret("missing", 100));
    BOOST_TEST(!folder.read_text("missing", 100));
}

BOOST_AUTO_TEST_CASE(a_secret_is_for_its_owner_only) {
    for (const unsigned mode : {0601U, 0602U, 0604U, 0610U, 0620U, 0640U, 0644U, 0666U, 0777U}) {
        put("key", "text", mode);
        BOOST_TEST(secret_refusal("key") == path("key") + " is accessible to other users: chmod 600 " + path("key"));
    }
    for (const unsigned mode : {0400U, 0600U, 0700U}) {
        put("key", "text", mode);
        BOOST_TEST(secret_refusal("key") == "");
    }
}

BOOST_AUTO_TEST_CASE(other_files_are_written_by_their_owner_only) {
    for (const unsigned mode : {0622U, 0664U, 0646U, 0620U, 0602U, 0666U}) {
        put("roster", "text", mode);
        BOOST_TEST(text_refusal("roster") ==
                   path("roster") + " can be changed by other users: chmod go-w " + path("roster"));
    }
    for (const unsigned mode : {0644U, 0600U, 0444U, 0755U}) {
        put("roster", "text", mode);
        BOOST_TEST(text_refusal("roster") == "");
    }
}

BOOST_AUTO_TEST_CASE(the_folder_is_written_by_its_owner_only) {
    for (const unsigned mode : {0770U, 0707U, 0722U, 0777U, 01777U}) {
        set_mode(own.path(), mode);
        BOOST_TEST(refusal([&] { return protected_folder{own.path()}; }) ==
                   own.path() + " can be changed by other users: chmod go-w " + own.path());
    }
    for (const unsigned mode : {0755U, 0750U, 0700U}) {
        set_mode(own.path(), mode);
        BOOST_TEST(refusal([&] { return protected_folder{own.path()}; }) == "");
    }
}

BOOST_AUTO_TEST_CASE(files_of_other_users_are_refused) {
    put("key", "text", 0600);
    put("roster", "text", 0644);
    if (geteuid() != 0) {
        BOOST_TEST_MESSAGE("only root can give files to another user");
        BOOST_TEST(secret_refusal("key") == "");
        return;
    }
    for (const std::string name : {"key", "roster"}) {
        BOOST_REQUIRE(chown(path(name).c_str(), other_user, 0) == 0);
    }
    const auto wrong = [&](const std::string& where) {
        return where + " belongs to the user 54321, not to root: chown root " + where;
    };
    BOOST_TEST(secret_refusal("key") == wrong(path("key")));
    BOOST_TEST(text_refusal("roster") == wrong(path("roster")));
    BOOST_REQUIRE(chown(own.path().c_str(), other_user, 0) == 0);
    BOOST_TEST(refusal([&] { return protected_folder{own.path()}; }) == wrong(own.path()));
}

BOOST_AUTO_TEST_CASE(a_user_may_use_files_of_root) {
    put("key", "text", 0600);
    if (geteuid() != 0) {
        BOOST_TEST_MESSAGE("only root can become another user");
        BOOST_TEST(secret_refusal("key") == "");
        return;
    }
    put("roster", "text", 0644);
    put("own", "text", 0600);
    BOOST_REQUIRE(chown(path("own").c_str(), other_user, 0) == 0);
    set_mode(own.path(), 0755);
    BOOST_REQUIRE(seteuid(other_user) == 0);
    const auto of_folder = refusal([&] { return protected_folder{own.path()}; });
    const auto of_roster = text_refusal("roster");
    const auto of_own = secret_refusal("own");
    const auto of_key = secret_refusal("key");
    BOOST_REQUIRE(seteuid(0) == 0);
    BOOST_TEST(of_folder == "");
    BOOST_TEST(of_roster == "");
    BOOST_TEST(of_own == "");
    BOOST_TEST(of_key == "cannot open " + path("key") + ": Permission denied");
}

BOOST_AUTO_TEST_CASE(what_is_not_a_regular_file_is_refused) {
    put("target", "text", 0600);
    fs::create_symlink("target", own / "link");
    fs::create_symlink("missing", own / "dangling");
    for (const std::string name : {"link", "dangling"}) {
        BOOST_TEST(secret_refusal(name) == path(name) + " is a symbolic link: replace it by the file itself");
        BOOST_TEST(text_refusal(name) == path(name) + " is a symbolic link: replace it by the file itself");
    }
    BOOST_REQUIRE(mkfifo(path("fifo").c_str(), 0600) == 0); // does not wait for a writer
    fs::create_directory(own / "folder");
    set_mode(own / "folder", 0700);
    for (const std::string name : {"fifo", "folder"}) {
        BOOST_TEST(secret_refusal(name) == path(name) + " is not a regular file");
        BOOST_TEST(text_refusal(name) == path(name) + " is not a regular file");
    }
}

BOOST_AUTO_TEST_CASE(a_file_has_a_largest_size) {
    put("file", "12345", 0600);
    BOOST_TEST(secret_refusal("file", 5) == "");
    BOOST_TEST(text_refusal("file", 5) == "");
    BOOST_TEST(secret_refusal("file", 4) == path("file") + " has 5 bytes; at most 4 are possible");
    BOOST_TEST(text_refusal("file", 4) == path("file") + " has 5 bytes; at most 4 are possible");
    // Without being read.
    put("sparse", "", 0600);
    BOOST_REQUIRE(truncate(path("sparse").c_str(), off_t{1} << 40U) == 0);
    BOOST_TEST(contains(text_refusal("sparse", 1'000'000), "has 1099511627776 bytes"));
}

BOOST_AUTO_TEST_CASE(proposed_commands_are_quoted) {
    const auto name = std::string{"it's $HOME"};
    put(name, "text", 0644);
    BOOST_TEST(secret_refusal(name) ==
               path(name) + " is accessible to other users: chmod 600 '" + own.path() + "/it'\\''s $HOME'");
}

BOOST_AUTO_TEST_CASE(a_missing_folder_is_an_error) {
    BOOST_TEST(refusal([&] { return protected_folder{path("none")}; }) ==
               "cannot open the folder " + path("none") + ": No such file or directory");
    put("file", "text", 0600);
    BOOST_TEST(refusal([&] { return protected_folder{path("file")}; }) ==
               "cannot open the folder " + path("file") + ": Not a directory");
}

BOOST_AUTO_TEST_CASE(a_folder_is_created_for_its_owner_only) {
    const auto made = protected_folder::create(path("new"));
    BOOST_TEST(mode_of(own / "new") == 0700U);
    made.create_file("file", bytes_of("text"), file_access::secret);
    BOOST_TEST(*protected_folder::create(path("new")).read_text("file", 10) == "text");
    BOOST_TEST(contains(refusal([&] { return protected_folder::create(path("none/below")); }),
                        "cannot create the folder " + path("none/below")));
    set_mode(own / "new", 0777);
    BOOST_TEST(contains(refusal([&] { return protected_folder::create(path("new")); }), "chmod go-w"));
}

BOOST_AUTO_TEST_CASE(written_files_have_their_mode_whatever_the_umask) {
    for (const mode_t mask : {mode_t{0}, mode_t{022}, mode_t{0777}}) {
        const auto before = umask(mask);
        folder.replace_file("secret", bytes_of("s"), file_access::secret);
        folder.replace_file("public", bytes_of("p"), file_access::readable);
        umask(before);
        BOOST_TEST(mode_of(own / "secret") == 0600U);
        BOOST_TEST(mode_of(own / "public") == 0644U);
    }
}

BOOST_AUTO_TEST_CASE(a_file_is_created_once) {
    folder.create_file("key", bytes_of("first"), file_access::secret);
    BOOST_TEST(refusal([&] {
                   folder.create_file("key", bytes_of("second"), file_access::secret);
                   return 0;
               }) == "cannot create " + path("key") + ": File exists");
    BOOST_TEST(read_file(own / "key") == "first");
    fs::create_symlink("elsewhere", own / "link");
    BOOST_CHECK_THROW(folder.create_file("link", bytes_of("x"), file_access::secret), security_error);
    BOOST_TEST(!fs::exists(own / "elsewhere"));
    BOOST_TEST(own.names() == (std::vector<std::string>{"key", "link"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_file_is_replaced_as_a_whole) {
    folder.replace_file("roster", bytes_of("first"), file_access::readable);
    folder.replace_file("roster", bytes_of("2"), file_access::readable);
    BOOST_TEST(read_file(own / "roster") == "2");
    // A link is replaced, and not what it points to.
    put("target", "text", 0600);
    fs::create_symlink("target", own / "link");
    folder.replace_file("link", bytes_of("new"), file_access::readable);
    BOOST_TEST(!fs::is_symlink(own / "link"));
    BOOST_TEST(read_file(own / "target") == "text");
    BOOST_TEST(own.names() == (std::vector<std::string>{"link", "roster", "target"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_write_that_fails_leaves_the_old_file_and_nothing_else) {
    put("roster", "old", 0644);
    const std::string much(100'000, 'x');
    std::string why;
    {
        const file_size_limit limit{4096};
        why = refusal([&] {
            folder.replace_file("roster", bytes_of(much), file_access::readable);
            return 0;
        });
    }
    BOOST_TEST(contains(why, "File too large"), why);
    BOOST_TEST(read_file(own / "roster") == "old");
    fs::create_directory(own / "folder");
    BOOST_CHECK_THROW(folder.replace_file("folder", bytes_of("x"), file_access::readable), security_error);
    BOOST_TEST(own.names() == (std::vector<std::string>{"folder", "roster"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(names_are_listed) {
    for (const std::string_view name : {"b.join", "a.join", "roster", ".hidden.join", "join", "a.join.old"}) {
        put(name, "", 0644);
    }
    const std::vector<std::string> expected{"a.join", "b.join"};
    BOOST_TEST(folder.names_ending(".join") == expected, boost::test_tools::per_element());
    BOOST_TEST(folder.names_ending(".join") == expected, boost::test_tools::per_element()); // again, from the start
    BOOST_TEST(folder.names_ending(".none").empty());
}

BOOST_AUTO_TEST_CASE(a_lock_is_held_by_one) {
    auto first = folder.lock(".lock");
    BOOST_TEST(mode_of(own / ".lock") == 0600U);
    const descriptor other{open(path(".lock").c_str(), O_RDWR | O_CLOEXEC)};
    BOOST_TEST(flock(other.get(), LOCK_EX | LOCK_NB) != 0);
    first = descriptor{};
    BOOST_TEST(flock(other.get(), LOCK_EX | LOCK_NB) == 0);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace protected_files
