/** Hands a text to whoever sits at the page, as a file. */
export function download(name: string, type: string, text: string): void {
  downloadFile(name, new Blob([text], { type }));
}

/** Hands a file to whoever sits at the page. */
export function downloadFile(name: string, file: Blob): void {
  const url = URL.createObjectURL(file);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  // The browser has taken what it needs by the time that its own tasks are done.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
