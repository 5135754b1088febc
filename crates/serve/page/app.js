document.getElementById("app").innerHTML = "<p>Resight answers at this address. The interface is described in <a href=\"/openapi.json\">/openapi.json</a>.</p>";
