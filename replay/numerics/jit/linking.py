"""Code of kernels as numba's code libraries, which reach into it as `compiler` does; see there."""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm

from replay.numerics.jit.records import is_address

NEEDED: tuple[tuple[Any, tuple[str, ...]], ...] = ()
"""What of numba is needed here: names by where they are; empty where it cannot be imported."""

try:
    from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
    from numba.core.environment import lookup_environment

    NEEDED = (
        (
            JITCodeLibrary,
            ("_unserialize", "_finalize_final_module", "_finalize_dynamic_globals", "add_llvm_module", "add_ir_module"),
        ),
        (JITCPUCodegen, ("set_env", "_module_pass_manager", "_library_class")),
    )
except ImportError:  # another numba
    JITCodeLibrary: Any = object  # type: ignore[no-redef]


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The LLVM code of one function; what it calls is in the libraries it links, until `emit` puts all into one."""

    environment = ""
    """Name of the variable that holds what the function that Python calls needs of Python."""
    _emitted = False
    _shared_module: Any

    def add_ir_module(self, module: Any) -> None:
        """Take in code as numba writes it; nobody writes to a record but where it is laid down (see `records`)."""
        for function in module.functions:
            for argument in function.args:
                if is_address(argument.type):
                    for promise in ("noalias", "captures(none)"):
                        argument.add_attribute(promise)
                    layout, target = argument.type.pointee, self._codegen.target_data
                    argument.attributes.dereferenceable = layout.get_abi_size(target)
                    argument.attributes.align = layout.get_abi_alignment(target)
        super().add_ir_module(module)

    def add_llvm_module(self, module: Any) -> None:
        """Take in code as it is."""
        module.data_layout = self._codegen._data_layout
        self._final_module.link_in(module)

    def finalize(self) -> None:
        """Take nothing in any more; nothing is optimised yet."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return a function's address, 0 if it has none."""
        address: int = super().get_pointer_to_function(name) if self._emitted else 0
        return address

    def emit(self) -> None:
        """Link all that is reached, optimise it, and make machine code.

        Optimised twice, at first without vectors: what is small by then is inlined, and its loops become vectors (with
        one pass, a cone's walk of the tree and a ray's took twice as long; the other costs a fifth of the passes).
        """
        self._link_reached(self._final_module)
        for variable in self._final_module.global_variables:
            environment = variable.name.startswith("_ZN08NumbaEnv") and not variable.is_declaration
            if environment and variable.name != self.environment:
                # of functions that are taken in, and need none: seen by others, it would stand for that of the same
                # function where Python calls it, which would be left without
                variable.linkage = "internal"
        for options in ({"loop_vectorize": False}, {}):
            manager, builder = self._codegen._module_pass_manager(**options)
            manager.run(self._final_module, builder)
        self._final_module.verify()
        self._finalize_final_module()
        self._emitted = True
        own = lookup_environment(self.environment)
        if own is not None:
            JITCPUCodegen.set_env(self._codegen, self.environment, own)

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Return machine code and, in place of code for other functions to take in, the names of what it defines."""
        names = (f'define void @"{function.name}"() {{ ret void }}' for function in self.get_defined_functions())
        return self.name, "object", (self._get_compiled_object(), llvm.parse_assembly("\n".join(names)).as_bitcode())

    def _link_reached(self, module: Any) -> None:
        """Put the code of all that is reached into a module, each function once."""
        found = set()
        waiting = list(self._linking_libraries)
        while waiting:
            library = waiting.pop()
            if library in found:
                continue
            found.add(library)
            if isinstance(library, KernelLibrary):
                waiting.extend(library._linking_libraries)
                module.link_in(library._for_callers(), preserve=True)
            else:
                module.link_in(library._get_module_for_linking(), preserve=True)

    def _for_callers(self) -> Any:
        """Return the function's own code, in a form that may stand in several modules."""
        self._ensure_finalized()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        return self._final_module

    def _get_module_for_linking(self) -> Any:
        """Return the code with all that it reaches: what a function that is no kernel takes in."""
        if self._shared_module is None:
            module = self._for_callers().clone()
            self._link_reached(module)
            self._shared_module = module
        return self._shared_module
