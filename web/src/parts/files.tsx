// Files from the person: dropped anywhere on an element, or chosen; and files to the person.
import { useSignal } from "@preact/signals";
import { useRef } from "preact/hooks";

/** An area that files can be dropped on. */
export function Drop({ onFiles, children, label, ...rest }: { onFiles: (files: File[]) => void; children: preact.ComponentChildren; label: string; class?: string }) {
  const over = useSignal(false);
  return (
    <div
      {...rest}
      role="group"
      aria-label={label}
      data-over={over.value}
      onDragOver={(event) => {
        event.preventDefault();
        over.value = true;
      }}
      onDragLeave={() => (over.value = false)}
      onDrop={(event) => {
        event.preventDefault();
        over.value = false;
        const files = [...(event.dataTransfer?.files ?? [])];
        if (files.length) onFiles(files);
      }}
    >
      {children}
    </div>
  );
}

export interface PickProps {
  accept?: string;
  /** `environment`: phones offer their camera. */
  capture?: "environment";
  multiple?: boolean;
  class?: string;
  onFiles: (files: File[]) => void;
  children: preact.ComponentChildren;
}

/** A button that opens the system's file dialogue. */
export function Pick({ accept, capture, multiple, onFiles, children, ...rest }: PickProps) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button {...rest} onClick={() => input.current?.click()}>{children}</button>
      <input
        ref={input}
        type="file"
        hidden
        accept={accept}
        capture={capture}
        multiple={multiple}
        onChange={(event) => {
          const chosen = event.currentTarget;
          const files = [...(chosen.files ?? [])];
          chosen.value = "";
          if (files.length) onFiles(files);
        }}
      />
    </>
  );
}

/** Hands a file to the person. */
export function download(name: string, blob: Blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
