/** Hands a file to whoever sits at the page. */
export function download(name: string, type: string, text: string): void {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  // The browser has taken what it needs by the time that its own tasks are done.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
