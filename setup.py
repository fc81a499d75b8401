"""Builds the Python module: against this tree's static library, which make builds first, or an installed libkarst.

KARST_LIBRARY=pkg-config takes the installed one, KARST_LIBRARY=some/libkarst.a another static one, and some/libkarst.so
one that is going to be installed. Which interpreter
it is built for does not matter from Python 3.11 on: it uses the stable ABI.
"""
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
LIBRARY = os.environ.get("KARST_LIBRARY", "")
IS_SHARED = LIBRARY.endswith(".so")
IS_INSTALLED = LIBRARY == "pkg-config" or IS_SHARED


def pkg_config(*arguments):
    return shlex.split(subprocess.run(["pkg-config", *arguments], check=True, capture_output=True, text=True).stdout)


def libraries():
    """What the static library needs, as the Makefile has it."""
    text = (ROOT / "Makefile").read_text()
    packages = re.search(r"^PKGS\s*:=(.*)$", text, re.M).group(1).split()
    others = re.search(r"^KLIBS\s*:=.*\)(.*)$", text, re.M).group(1).split()
    return [*pkg_config("--libs", *packages), *others]


def static_library():
    if LIBRARY:
        return LIBRARY
    path = os.path.join("build", "libkarst.a")
    subprocess.run(["make", f"-j{os.cpu_count() or 1}", path], check=True, cwd=ROOT)
    return path


class BuildExtension(build_ext):
    def build_extension(self, extension):
        if IS_SHARED:
            extension.include_dirs.append("core/include")
            extension.extra_link_args.append(LIBRARY)
            extension.depends.append(LIBRARY)
        elif IS_INSTALLED:
            extension.extra_compile_args += pkg_config("--cflags", "karst")
            extension.extra_link_args += pkg_config("--libs", "karst")
        else:
            library = static_library()
            extension.extra_objects.append(library)
            extension.depends.append(library)
            extension.include_dirs.append("core/include")
            extension.extra_link_args += [*libraries(), "-Wl,--exclude-libs,ALL"]
        super().build_extension(extension)


class BuildPython(build_py):
    """Worlds and paths lie beside the module, where the library in it looks; an installed one has its own."""

    def run(self):
        super().run()
        for kind, suffix in (("worlds", ".karst"), ("paths", ".json")):
            folder = Path(self.build_lib, "karst", "share", "karst", kind)
            if IS_INSTALLED:
                continue
            folder.mkdir(parents=True, exist_ok=True)
            for file in sorted((ROOT / "demos" / kind).glob("*" + suffix)):
                shutil.copyfile(file, folder / file.name)


os.makedirs(ROOT / "build" / "python", exist_ok=True)
setup(
    version=re.search(r"^VERSION\s*:=\s*(\S+)", (ROOT / "Makefile").read_text(), re.M).group(1),
    ext_modules=[Extension("karst._karst", sorted(str(p.relative_to(ROOT)) for p in ROOT.glob("python/source/*.c")),
                           depends=["python/source/common.h", "setup.py"], extra_compile_args=["-std=c11", "-fvisibility=hidden"], py_limited_api=True)],
    cmdclass={"build_ext": BuildExtension, "build_py": BuildPython},
)
